"""Chunks of a recording are split into the same records as by the mcap package, and damaged ones are refused."""

from __future__ import annotations

import struct
import zlib
from dataclasses import replace

import lz4.frame
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message
from mcap.stream_reader import CRCValidationError, breakup_chunk

from sessions.recording.traffic.mcap_chunks import LARGEST_CHUNK_bytes, split_chunk


def record(opcode: int, content: bytes, length: int | None = None) -> bytes:
    return struct.pack("<BQ", opcode, len(content) if length is None else length) + content


def text(word: str) -> bytes:
    return struct.pack("<I", len(word)) + word.encode()


CHANNEL = record(Opcode.CHANNEL, struct.pack("<HH", 7, 0) + text("/link/hand/rx") + text("raw") + struct.pack("<I", 0))
FIRST = record(Opcode.MESSAGE, struct.pack("<HIQQ", 7, 1, 20, 21) + b"bytes of the hand")
EMPTY = record(Opcode.MESSAGE, struct.pack("<HIQQ", 7, 2, 30, 31))
UNKNOWN = record(0x7F, b"of a later version")


def chunk(data: bytes, compression: str = "", crc: int | None = None, size: int | None = None) -> Chunk:
    packed = {"zstd": zstandard.compress, "lz4": lz4.frame.compress}.get(compression, bytes)(data)
    return Chunk(
        compression=compression,
        data=packed,
        message_end_time=0,
        message_start_time=0,
        uncompressed_crc=zlib.crc32(data) if crc is None else crc,
        uncompressed_size=len(data) if size is None else size,
    )


@pytest.mark.parametrize("compression", ["", "zstd", "lz4"])
def test_records_are_those_of_the_mcap_package(compression: str) -> None:
    whole = chunk(CHANNEL + FIRST + UNKNOWN + EMPTY, compression)
    assert split_chunk(whole) == breakup_chunk(whole, validate_crc=True)
    assert [type(each) for each in split_chunk(whole)] == [Channel, Message, Message]


def test_messages_of_unwanted_channels_are_left_out_and_those_of_undescribed_ones_are_not() -> None:
    whole = chunk(FIRST + CHANNEL + EMPTY)
    assert [type(each) for each in split_chunk(whole, lambda channel: channel.topic == "/other")] == [Message, Channel]
    assert split_chunk(whole, lambda channel: channel.topic == "/link/hand/rx") == split_chunk(whole)


def test_an_empty_chunk_has_no_records() -> None:
    assert split_chunk(chunk(b"")) == []


@pytest.mark.parametrize(
    ("damaged", "error"),
    [
        (chunk(CHANNEL + FIRST, crc=1), CRCValidationError),
        (chunk(FIRST[:-1]), ValueError),  # longer than its chunk
        (chunk(FIRST + EMPTY[:5]), struct.error),  # cut in its head
        (chunk(record(Opcode.MESSAGE, b"short")), ValueError),
        (chunk(record(Opcode.MESSAGE, FIRST, length=1 << 60)), ValueError),
        (chunk(b"", size=LARGEST_CHUNK_bytes + 1), ValueError),
        (chunk(FIRST, compression="bz2"), ValueError),
        (replace(chunk(FIRST), compression="lz4"), ValueError),  # no LZ4 frame
        (chunk(bytes(1 << 20), compression="lz4", size=1000), CRCValidationError),  # larger than it says
    ],
)
def test_damaged_chunks_are_refused(damaged: Chunk, error: type[Exception]) -> None:
    with pytest.raises(error):
        split_chunk(damaged)
