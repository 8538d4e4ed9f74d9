"""The counters and clocks that devices send, as a recording keeps them beside each message."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from drivers.camera.frames import Detection, Frame
from drivers.camera.packet import encode_packet
from sessions.recording.device_stamps import STAMPERS, camera_stamp, positioner_stamp, rdt_stamp
from sessions.recording.traffic.raw_frames import UNSTAMPED, DeviceStamp


def rdt(number: int, measured: int) -> bytes:
    return struct.pack(">III6i", number, measured, 0, *range(6))


def test_force_records_tell_the_number_of_the_first_and_how_many_and_a_clock_of_seven_kilohertz() -> None:
    assert rdt_stamp(rdt(41, 7000) + rdt(42, 7007)) == DeviceStamp(41, 7000 * (1_000_000_000 // 7000), 2)
    assert rdt_stamp(rdt(41, 0)) == DeviceStamp(41, 0, 1)


@pytest.mark.parametrize("payload", [b"", rdt(1, 1)[:-1], rdt(1, 1) + b"\0"])
def test_other_bytes_than_whole_force_records_have_no_stamp(payload: bytes) -> None:
    assert rdt_stamp(payload) == UNSTAMPED


def test_a_cameras_frames_are_numbered_and_a_bare_picture_is_not() -> None:
    packet = encode_packet(Frame(0, np.zeros((2, 2), np.uint8), 77, 3, Detection("DICT_4X4_50", (2, 2), {})))
    assert camera_stamp(packet) == DeviceStamp(77)
    assert camera_stamp(b"\xff\xd8\xff") == DeviceStamp(None)
    assert camera_stamp(packet[:10]) == DeviceStamp(None)


def test_a_positioner_answers_a_numbered_command() -> None:
    status = struct.pack("<I", 9) + bytes(48)
    assert positioner_stamp(status) == DeviceStamp(9)
    assert positioner_stamp(status + bytes(8)) == DeviceStamp(9)
    assert positioner_stamp(status[:-1]) == UNSTAMPED


def test_stamps_are_read_by_the_kind_of_wire() -> None:
    assert STAMPERS["net-ft"] is STAMPERS["nano17"] is rdt_stamp
    assert STAMPERS["six-axis"] is STAMPERS["ur"] is positioner_stamp
