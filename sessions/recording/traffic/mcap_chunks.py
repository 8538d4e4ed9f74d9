"""Splits a chunk of a recording into its records.

The mcap package reads records number by number; taking them apart in one step is several times faster, and reading
recordings spends most of its time here.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from io import BytesIO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message
from mcap.stream_reader import get_chunk_data_stream

LARGEST_CHUNK_bytes = 16 << 20
"""A chunk is closed after 64 KiB: more is a picture. A small file may claim to hold gigabytes."""

_KEPT_bytes = 4096
_MESSAGE_OPCODE, _CHANNEL_OPCODE = int(Opcode.MESSAGE), int(Opcode.CHANNEL)
_HEAD = struct.Struct("<BQ")  # opcode, length
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time


def split_chunk(chunk: Chunk, is_wanted: Callable[[Channel], bool] | None = None) -> list[McapRecord]:
    """The messages and channels in a chunk, in their order; other records are left out.

    Args:
        chunk: packed by zstd or LZ4, as other programs rewrite a recording, or not at all.
        is_wanted: tells of a channel that the chunk describes whether its messages are; None: all messages are.

    Raises:
        ValueError, McapError, zstandard.ZstdError, struct.error: the chunk is too large or damaged.
    """
    _check_size(chunk)
    chunk = _without_lz4(chunk) if chunk.compression == "lz4" else chunk
    stream, size = get_chunk_data_stream(chunk, validate_crc=True)
    data = stream.read(size)
    records: list[McapRecord] = []
    unwanted: set[int] = set()
    position = 0
    while position < size:
        opcode, length = _HEAD.unpack_from(data, position)
        start = position + _HEAD.size
        position = start + length
        if position > size:
            raise ValueError("a record is longer than its chunk")
        if opcode == _MESSAGE_OPCODE:
            if position - start < _MESSAGE.size:
                raise ValueError("a message is too short")
            if not unwanted or data[start] | data[start + 1] << 8 not in unwanted:  # its channel
                records.append(_message(data, start, position))
        elif opcode == _CHANNEL_OPCODE:
            channel = _channel(data[start:position])
            if is_wanted is not None and not is_wanted(channel):
                unwanted.add(channel.id)
            records.append(channel)
    return records


def _channel(content: bytes) -> Channel:
    """A channel, as every chunk describes it again."""
    return _known_channel(content) if len(content) <= _KEPT_bytes else _read_channel(content)


def _read_channel(content: bytes) -> Channel:
    channel: Channel = Channel.read(ReadDataStream(BytesIO(content)))
    return channel


_known_channel = lru_cache(maxsize=256)(_read_channel)


def _message(data: bytes, start: int, end: int) -> Message:
    channel_id, sequence, log_time, publish_time = _MESSAGE.unpack_from(data, start)
    return Message(channel_id, log_time, data[start + _MESSAGE.size : end], publish_time, sequence)


def _check_size(chunk: Chunk) -> None:
    """No recorder writes larger chunks, and unpacking one needs no more memory. Raises ValueError."""
    packed = zstandard.frame_content_size(chunk.data) if chunk.compression == "zstd" else len(chunk.data)
    if chunk.compression not in ("", "zstd", "lz4") or max(chunk.uncompressed_size, packed) > LARGEST_CHUNK_bytes:
        raise ValueError(f"a chunk of {max(chunk.uncompressed_size, packed)} bytes, packed by {chunk.compression!r}")


def _without_lz4(chunk: Chunk) -> Chunk:
    """The chunk unpacked: its frame need not say how large it is, so that it may not grow beyond what the chunk says.
    Raises ValueError.
    """
    try:
        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=chunk.uncompressed_size)
    except (RuntimeError, EOFError) as error:
        raise ValueError(f"LZ4: {error}") from error
    return replace(chunk, compression="", data=data)
