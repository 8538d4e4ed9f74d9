from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.errors import CodecError
from drivers.shadow.protocol.motor_data import (
    CONFIG_TYPES,
    SERIOUS_FLAGS,
    MotorFlag,
    ToMotor,
    as_signed,
    celsius,
    config_crc,
    config_upload,
    crc16,
    describe_flags,
    volts,
)


def test_checksums_match_the_golden_vectors(lab_data: Path) -> None:
    golden = json.loads((lab_data / "golden_vectors.json").read_text())
    for joint, example in golden["motor_config_crc"].items():
        assert config_crc(example["words_5_to_E"]) == int(example["crc"], 16), joint
    assert crc16(b"123456789") == int(golden["motor_crc_bytes_123456789"], 16) == 0x169A


def test_a_zero_checksum_is_sent_as_one() -> None:
    assert crc16(bytes(20)) == 0
    assert config_crc([0] * 10) == 1


@settings(max_examples=50, deadline=None, derandomize=True)
@given(words=st.lists(st.integers(0, 0xFFFF), min_size=10, max_size=10), bit=st.integers(0, 159))
def test_a_single_wrong_bit_changes_the_checksum(words: list[int], bit: int) -> None:
    damaged = words.copy()
    damaged[bit // 16] ^= 1 << bit % 16
    data = [np.array(each, "<u2").tobytes() for each in (words, damaged)]
    assert crc16(data[0]) != crc16(data[1])


@pytest.mark.parametrize("words", [[0] * 9, [0] * 11, [0] * 9 + [0x10000], [0] * 9 + [-1]])
def test_configurations_of_the_wrong_size_are_refused(words: list[int]) -> None:
    with pytest.raises(CodecError, match="10 words"):
        config_crc(words)


def test_an_upload_sends_ten_words_and_then_the_checksum() -> None:
    words = [500, 64, 600, 0, 300, 4500, 0, 0, 0, 5]
    upload = config_upload(words)
    assert [kind for kind, _ in upload] == [*CONFIG_TYPES, ToMotor.CONFIG_CRC]
    assert [int(kind) for kind, _ in upload] == list(range(5, 16))
    assert [word for _, word in upload] == [*words, 0x1068]


def test_flags_read_as_words() -> None:
    assert describe_flags(0) == ()
    assert describe_flags(MotorFlag.CURRENT_CHOKE | 0x0100) == ()
    assert describe_flags(0x8000 | 0x0400) == ("halted, no demand for 20 ms", "halted, over temperature")


def test_every_named_flag_has_its_own_words() -> None:
    words = {describe_flags(flag) for flag in MotorFlag if flag & ~0xF}
    assert len(words) == 11
    assert all(len(each) == 1 for each in words)


def test_serious_flags_are_those_that_halt_a_motor() -> None:
    assert SERIOUS_FLAGS == 0x0400 | 0x2000 | 0x4000 | 0x8000


def test_misc_words_convert_to_their_units() -> None:
    misc = np.array([0xFF97, 120, 0x1880], np.uint16)
    assert as_signed(misc).tolist() == [-105, 120, 0x1880]
    assert celsius(misc)[2] == 24.5
    assert volts(misc)[2] == 24.5
