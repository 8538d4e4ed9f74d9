"""Records of a file that nobody meant to be a recording."""

from __future__ import annotations

import struct
from io import BytesIO

import pytest
from mcap.opcode import Opcode

from sessions.recording.traffic.mcap_frames import DAMAGE, Frames
from tests.support.flipped_bytes import make_recording

MAGIC = b"\x89MCAP0\r\n"


@pytest.mark.parametrize("length", [0, 21])
def test_messages_without_room_for_a_stamp_are_no_records(length):
    frames = Frames(BytesIO(MAGIC + (struct.pack("<BQ", Opcode.MESSAGE, length) + bytes(length)) * 1000))
    assert list(frames) == []
    assert frames.unreadable_bytes == 1000 * (9 + length)


def test_what_follows_such_messages_is_read(tmp_path):
    made = make_recording(tmp_path, 30)
    first = len(MAGIC)
    content = made.content[:first] + struct.pack("<BQ", Opcode.MESSAGE, 0) * 5 + made.content[first:]
    found, sound = (list(Frames(BytesIO(each))) for each in (content, made.content))
    assert found[0] == (DAMAGE, b"")
    assert [record for record in sound if record[0] == Opcode.CHUNK] == [
        record for record in found if record[0] == Opcode.CHUNK
    ]
