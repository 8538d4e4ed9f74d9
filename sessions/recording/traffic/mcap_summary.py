"""The summary at the end of a whole MCAP file: topics, counts, and where everything stands."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from io import BytesIO
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, MetadataIndex, Statistics
from mcap.writer import MCAP0_MAGIC

_FRAME = struct.Struct("<BQ")
_FOOTER = struct.Struct("<BQQQI")
_CHUNK_INDEX = struct.Struct("<QQQQI")  # first and last stamp, offset, length, length of the message indices' offsets
_INDEX_OFFSET = struct.Struct("<HQ")  # channel, offset
_DATA_END_BYTES = 13
_LARGEST_bytes = 1 << 28


@dataclass(frozen=True)
class Summary:
    """What a whole file says of itself.

    Attributes:
        topics: by channel.
        counts: messages by channel.
        landmarks: offsets at which records begin, ascending.
    """

    topics: dict[int, str]
    counts: dict[int, int]
    landmarks: tuple[int, ...]


NOTHING = Summary({}, {}, ())


def read_summary(file: BinaryIO) -> Summary:
    """The summary of a file; :data:`NOTHING` where there is none, or it is damaged."""
    size = file.seek(0, 2)
    ending = _FOOTER.size + len(MCAP0_MAGIC)
    file.seek(max(0, size - ending))
    tail = file.read()
    if len(tail) < ending or not tail.endswith(MCAP0_MAGIC):
        return NOTHING
    opcode, length, start, _, checksum = _FOOTER.unpack_from(tail)
    if opcode != Opcode.FOOTER or length != _FOOTER.size - _FRAME.size or not 0 < start <= size - ending:
        return NOTHING
    if size - ending - start > _LARGEST_bytes:
        return NOTHING
    file.seek(start)
    content = file.read(size - ending - start)
    if checksum != zlib.crc32(content + tail[: _FOOTER.size - 4]):
        return NOTHING
    try:
        return _parse(content, start)
    except (McapError, struct.error, ValueError):
        return NOTHING


def _parse(content: bytes, start: int) -> Summary:
    topics: dict[int, str] = {}
    counts: dict[int, int] = {}
    landmarks = {start - _DATA_END_BYTES, start}
    position = 0
    while position < len(content):
        opcode, length = _FRAME.unpack_from(content, position)
        position += _FRAME.size
        record = content[position : position + length]
        stream = ReadDataStream(BytesIO(record))
        position += length
        if opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            topics[channel.id] = channel.topic
        elif opcode == Opcode.STATISTICS:
            counts = Statistics.read(stream).channel_message_counts
        elif opcode == Opcode.CHUNK_INDEX:
            landmarks |= _landmarks_of_chunk(record)
        elif opcode == Opcode.METADATA_INDEX:
            landmarks.add(MetadataIndex.read(stream).offset)
        elif opcode == Opcode.ATTACHMENT_INDEX:
            landmarks.add(AttachmentIndex.read(stream).offset)
    return Summary(topics, counts, tuple(sorted(landmarks)))


def _landmarks_of_chunk(record: bytes) -> set[int]:
    """Where a chunk, what follows it, and its message indices begin; the mcap package takes ten times as long."""
    _, _, start, length, size = _CHUNK_INDEX.unpack_from(record)
    offsets = _INDEX_OFFSET.iter_unpack(record[_CHUNK_INDEX.size : _CHUNK_INDEX.size + size])
    return {start, start + length, *(offset for _, offset in offsets)}
