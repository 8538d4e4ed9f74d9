"""MCAP files for a stream of many small messages.

Writes what the library's own writer would write, but puts a message into the chunk at hand in one go: hundreds come a
second, and the library spends ten times as long on each. Every chunk describes the channels of its messages again, so
that it can be read when the others are damaged. The records of which there are few are the library's. A chunk can be
taken from the writer and compressed and written later, by another thread.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

_MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
_MESSAGE_BYTES = _MESSAGE.size - 9  # as counted by the length
_INDEX = struct.Struct("<BQHI")  # opcode, length, channel, bytes of entries
_INDEX_BYTES = _INDEX.size - 9
_INDEX_ENTRY = struct.Struct("<QQ")  # log time, offset in the chunk
_FOOTER_START = struct.Struct("<BQQQ")
_FOOTER_BYTES = 20


class Output(Protocol):
    """A file that is written sequentially."""

    def write(self, data: bytes) -> int:
        """Append all of it."""

    def tell(self) -> int:
        """Bytes written so far."""


class McapWriter:
    """An MCAP file with zstd-compressed, indexed chunks, a summary and checksums.

    Args:
        output: the file to write; not closed here.
        chunk_bytes: size at which a chunk is written; None if the caller takes the chunks.
        profile, library: for the header.
    """

    def __init__(self, output: Output, chunk_bytes: int | None, profile: str, library: str) -> None:
        self._output, self._chunk_bytes = output, chunk_bytes
        self._compressor = zstandard.ZstdCompressor()
        self._chunk = PendingChunk()
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._encoded: dict[int, bytes] = {}
        self._chunk_indices = bytearray()  # as records: thousands come, and objects would take ten times as much
        self._chunk_count, self._span_ns = 0, (0, 0)
        self._metadata_indices: list[MetadataIndex] = []
        self._attachment_indices: list[AttachmentIndex] = []
        self._counts: Counter[int] = Counter()
        self._closing: tuple[str, Mapping[str, str]] | None = None
        output.write(MCAP0_MAGIC + _encode(Header(profile, library)))

    def add_metadata(self, name: str, content: Mapping[str, str]) -> None:
        """Write named texts."""
        offset, record = self._output.tell(), _encode(Metadata(name=name, metadata=dict(content)))
        self._output.write(record)
        self._metadata_indices.append(MetadataIndex(offset=offset, length=len(record), name=name))

    def add_closing_metadata(self, name: str, content: Mapping[str, str]) -> None:
        """Set named texts to follow the last message: :meth:`finish` writes them."""
        self._closing = (name, content)

    def add_attachment(self, name: str, media_type: str, data: bytes) -> None:
        """Write a whole file into this one."""
        record = _encode(Attachment(create_time=0, log_time=0, name=name, media_type=media_type, data=data))
        index = AttachmentIndex(self._output.tell(), len(record), 0, 0, len(data), name, media_type)
        self._output.write(record)
        self._attachment_indices.append(index)

    @property
    def pending_bytes(self) -> int:
        """Uncompressed size of the current chunk."""
        return len(self._chunk.records)

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Register a schema. Returns its number."""
        schema = Schema(id=len(self._schemas) + 1, data=data, encoding=encoding, name=name)
        self._schemas.append(schema)
        self._chunk.define(_encode(schema))
        return schema.id

    def add_channel(self, topic: str, message_encoding: str, schema: int = 0) -> int:
        """Register a channel, with the number of its schema or 0 for none. Returns its number."""
        number = len(self._channels) + 1
        channel = Channel(id=number, topic=topic, message_encoding=message_encoding, schema_id=schema, metadata={})
        self._channels.append(channel)
        self._encoded[number] = _encode(channel)
        self._chunk.define(self._encoded[number])
        self._chunk.described.add(number)
        return number

    def add_message(self, channel: int, log_ns: int, data: bytes, publish_ns: int, sequence: int) -> None:
        """Append one message. Log times must not decrease."""
        chunk = self._chunk
        if not chunk.entries:
            chunk.first_ns = log_ns
        if channel not in chunk.described:
            chunk.described.add(channel)
            chunk.records += self._encoded[channel]
        chunk.last_ns = log_ns
        chunk.entries.setdefault(channel, bytearray()).extend(_INDEX_ENTRY.pack(log_ns, len(chunk.records)))
        chunk.records += _MESSAGE.pack(
            Opcode.MESSAGE, _MESSAGE_BYTES + len(data), channel, sequence, log_ns, publish_ns
        )
        chunk.records += data
        self._counts[channel] += 1
        if self._chunk_bytes is not None and len(chunk.records) > self._chunk_bytes:
            self.flush()

    def flush(self) -> None:
        """Write the current chunk, unless it has no message."""
        if (chunk := self.detach()) is not None:
            self.write_chunk(chunk)

    def detach(self) -> PendingChunk | None:
        """Take the current chunk, for :meth:`write_chunk` or :meth:`drop`; None if it has no message."""
        if not self._chunk.entries:
            return None
        chunk, self._chunk = self._chunk, PendingChunk()
        return chunk

    def drop(self, chunk: PendingChunk) -> None:
        """Drop a chunk that will not be written: its schemas and channels are repeated in the current chunk, which must
        have no message yet.
        """
        self._chunk.define(bytes(chunk.definitions))
        self._counts.subtract(chunk.message_counts())

    def discard(self) -> None:
        """Discard the current chunk: writing a message into it was interrupted."""
        self._chunk = PendingChunk()

    def finish(self) -> None:
        """Write the remaining data and the summary."""
        self.flush()
        if self._closing is not None:
            self.add_metadata(*self._closing)
        self._output.write(_encode(DataEnd(0)))
        start = self._output.tell()
        summary, offsets = self._summary(start)
        offset_start = start + len(summary)
        summary += b"".join(map(_encode, offsets))
        checked = summary + _FOOTER_START.pack(Opcode.FOOTER, _FOOTER_BYTES, start, offset_start)
        self._output.write(summary)
        footer = Footer(summary_start=start, summary_offset_start=offset_start, summary_crc=zlib.crc32(checked))
        self._output.write(_encode(footer) + MCAP0_MAGIC)
        self._chunk_indices.clear()

    def write_chunk(self, chunk: PendingChunk) -> None:
        """Compress a chunk that was taken, and write it. Chunks must come in the order in which they were taken."""
        start = self._output.tell()
        record = Chunk(
            compression="zstd",
            data=self._compressor.compress(chunk.records),
            message_start_time=chunk.first_ns,
            message_end_time=chunk.last_ns,
            uncompressed_crc=zlib.crc32(chunk.records),
            uncompressed_size=len(chunk.records),
        )
        self._output.write(_encode(record))
        offsets, indices = chunk.index(end := self._output.tell())
        self._output.write(indices)
        self._span_ns = (self._span_ns[0] if self._chunk_count else chunk.first_ns, chunk.last_ns)
        self._chunk_count += 1
        self._chunk_indices += _encode(
            ChunkIndex(
                message_start_time=chunk.first_ns,
                message_end_time=chunk.last_ns,
                chunk_start_offset=start,
                chunk_length=end - start,
                message_index_offsets=offsets,
                message_index_length=len(indices),
                compression="zstd",
                compressed_size=len(record.data),
                uncompressed_size=len(chunk.records),
            )
        )

    def _summary(self, start: int) -> tuple[bytes, list[SummaryOffset]]:
        """The records of the summary, which begins at ``start``, and the offset of each kind."""
        groups: list[tuple[Opcode, bytes]] = [
            (Opcode.SCHEMA, _all_encoded(self._schemas)),
            (Opcode.CHANNEL, _all_encoded(self._channels)),
            (Opcode.STATISTICS, _encode(self._statistics())),
            (Opcode.CHUNK_INDEX, bytes(self._chunk_indices)),
            (Opcode.ATTACHMENT_INDEX, _all_encoded(self._attachment_indices)),
            (Opcode.METADATA_INDEX, _all_encoded(self._metadata_indices)),
        ]
        summary, offsets = bytearray(), []
        for opcode, group in groups:
            offsets.append(SummaryOffset(opcode, group_start=start + len(summary), group_length=len(group)))
            summary += group
        return bytes(summary), offsets

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=len(self._attachment_indices),
            channel_count=len(self._channels),
            channel_message_counts=dict(self._counts),
            chunk_count=self._chunk_count,
            message_count=sum(self._counts.values()),
            metadata_count=len(self._metadata_indices),
            message_start_time=self._span_ns[0],
            message_end_time=self._span_ns[1],
            schema_count=len(self._schemas),
        )


class PendingChunk:
    """Messages not yet written: their records, and the index entries by channel."""

    def __init__(self) -> None:
        self.records = bytearray()
        self.definitions = bytearray()
        self.described: set[int] = set()
        """Channels whose description is in it."""
        self.entries: dict[int, bytearray] = {}
        self.first_ns = self.last_ns = 0

    def define(self, records: bytes) -> None:
        """Add records of schemas or channels."""
        self.records += records
        self.definitions += records

    def message_counts(self) -> dict[int, int]:
        """Number of messages by channel."""
        return {channel: len(entries) // _INDEX_ENTRY.size for channel, entries in self.entries.items()}

    def index(self, start: int) -> tuple[dict[int, int], bytes]:
        """File offset of each channel's index, and the indices, which begin at ``start``."""
        offsets, indices = {}, bytearray()
        for channel, entries in self.entries.items():
            offsets[channel] = start + len(indices)
            indices += _INDEX.pack(Opcode.MESSAGE_INDEX, _INDEX_BYTES + len(entries), channel, len(entries)) + entries
        return offsets, bytes(indices)


def _all_encoded(records: Sequence[McapRecord]) -> bytes:
    return b"".join(map(_encode, records))


def _encode(record: McapRecord) -> bytes:
    builder: Any = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())
