"""The hand's decoder gives the same samples from the same bytes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.errors import CodecError
from drivers.core.transports import Datagram
from drivers.shadow.device.hand_samples import HandDecoder
from tests.support.fake_palm import (
    CALIBRATION,
    Rig,
    statuses,
)


def test_a_decoder_gives_the_same_samples_from_the_same_bytes() -> None:
    datagrams = list(statuses(Rig(), 30))
    runs = [[HandDecoder(CALIBRATION)] * len(datagrams) for _ in range(2)]
    first, second = ([d.receive(each) for d, each in zip(run, datagrams, strict=True)] for run in runs)
    for a, b in zip(first, second, strict=True):
        assert (a is None) == (b is None)
        if a is not None and b is not None:
            assert a.joints_rad.tobytes() == b.joints_rad.tobytes()
            assert a.motor.values.tobytes() == b.motor.values.tobytes()


def test_a_decoder_refuses_bytes_of_another_protocol() -> None:
    with pytest.raises(CodecError, match="231 bytes instead of 232"):
        HandDecoder(CALIBRATION).receive(Datagram(bytes(231), 0))


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.lists(st.binary(min_size=232, max_size=232), max_size=5))
def test_any_bytes_of_the_right_length_are_taken_without_failing(payloads: list[bytes]) -> None:
    decoder = HandDecoder(CALIBRATION)
    for payload in payloads:
        sample = decoder.receive(Datagram((1).to_bytes(4, "little") + payload[4:], 5))
        assert sample is None or np.isfinite(sample.joints_rad).all()
