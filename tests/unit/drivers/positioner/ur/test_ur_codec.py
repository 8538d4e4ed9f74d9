from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.errors import CodecError
from drivers.positioner.codec import PositionerCommand
from drivers.positioner.ur.codec import (
    COMMAND_BYTES,
    STATUS_BYTES,
    ArmFlags,
    ArmOrder,
    ArmState,
    ArmStatus,
    decode_arm_command,
    decode_arm_status,
    encode_arm_command,
    encode_arm_status,
)

number = st.floats(-1e6, 1e6)
state = st.builds(
    ArmState,
    number,
    st.integers(-1, 8),
    st.integers(0, 5),
    st.integers(0, 0x7FF),
    st.floats(0, 1),
    st.tuples(number, number, number),
    st.integers(0, 15).map(ArmFlags),
)


@given(state, st.integers(0, 0xFFFFFFFF), st.tuples(*[number] * 6))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_a_status_is_read_as_it_was_written(arm: ArmState, sequence: int, q: tuple[float, ...]) -> None:
    read = decode_arm_status(encode_arm_status(ArmStatus(sequence, np.array(q), arm)))
    assert (read.sequence, tuple(read.q), read.arm) == (sequence, q, arm)


@pytest.mark.parametrize("order", list(ArmOrder))
def test_a_command_keeps_its_targets_and_what_the_arm_shall_do(order: ArmOrder) -> None:
    read = decode_arm_command(encode_arm_command(PositionerCommand(7, np.arange(6.0)), order))
    assert (read.sequence, read.order) == (7, order)
    np.testing.assert_array_equal(read.targets, np.arange(6.0))


def test_other_bytes_are_refused() -> None:
    command = encode_arm_command(PositionerCommand(7, np.arange(6.0)), ArmOrder.FOLLOW)
    arm = ArmState(0.0, 7, 2, 1, 1.0, (0.0, 0.0, float("nan")), ArmFlags.HEARD)
    for payload in (b"", command[:-1], command[:-1] + b"\x09", bytes(COMMAND_BYTES)):
        with pytest.raises(CodecError, match="arm"):
            decode_arm_command(payload)
    for payload in (b"", bytes(STATUS_BYTES - 1), encode_arm_status(ArmStatus(1, np.zeros(6), arm))):
        with pytest.raises(CodecError, match="arm"):
            decode_arm_status(payload)
