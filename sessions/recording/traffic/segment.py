"""The messages of one file of a recording, as far as they can be read."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Collection, Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, MessageIndex, Metadata

from drivers.core.errors import SessionDataError
from drivers.core.reading.bounded_files import open_plain
from sessions.recording.traffic.files import END_RECORD
from sessions.recording.traffic.loss import Loss
from sessions.recording.traffic.mcap_chunks import split_chunk
from sessions.recording.traffic.mcap_frames import DAMAGE, Frames
from sessions.recording.traffic.mcap_summary import Summary, read_summary

UNREADABLE = (McapError, zstandard.ZstdError, struct.error, ValueError, OverflowError, MemoryError)
"""What the mcap package raises on damaged content."""


class SegmentMessages:
    """The messages of one file with their topics (None if unknown).

    Args:
        path: of the file.
        loss: to which it adds.
        expected: number of its first message.
        resumed: see :class:`~sessions.recording.traffic.mcap_frames.Frames`.
        topics: to read only these, in a fraction of the time; what is lost is then not known. None: all.
    """

    def __init__(
        self,
        path: Path,
        loss: Loss,
        expected: int,
        resumed: dict[tuple[int, int], int | None],
        topics: Collection[str] | None = None,
    ) -> None:
        self.end: dict[str, str] = {}
        self.lost_at_end = 0
        """Messages lost behind the last one read, by summary or index: no gap in the numbering shows them."""
        self._path, self._loss, self._resumed = path, loss, resumed
        self._wanted = topics
        self._topics: dict[int, str] = {}
        self._read: Counter[int] = Counter()
        self._indexed: Counter[int] = Counter()
        self._last_chunk: list[McapRecord] = []
        self._chunk_is_read = False
        self._gaps, self._expected = 0, expected

    def __iter__(self) -> Iterator[tuple[str | None, Message]]:
        with open_segment(self._path) as file:
            summary = read_summary(file)
            self._topics.update(summary.topics)
            frames = Frames(file, summary.landmarks, self._resumed)
            for opcode, content in frames:
                for record in self._records(opcode, content):
                    if isinstance(record, Channel):
                        self._topics[record.id] = record.topic
                    elif isinstance(record, Message):
                        self._note(record)
                        yield self._topics.get(record.channel_id), record
            self._loss.truncated |= not frames.complete
            self._loss.unreadable_bytes += frames.unreadable_bytes
            self._count_lost(summary)

    def _note(self, message: Message) -> None:
        self._read[message.channel_id] += 1
        self._gaps += (message.sequence - self._expected) & 0xFFFFFFFF
        self._expected = message.sequence + 1

    def _count_lost(self, summary: Summary) -> None:
        """What is lost of each topic: by the summary, else by the indices of chunks that could not be read."""
        lost = Counter(summary.counts) - self._read if summary.counts else self._indexed
        for channel, number in lost.items():
            topic = self._topics.get(channel, f"channel {channel}")
            self._loss.by_topic[topic] = self._loss.by_topic.get(topic, 0) + number
        self.lost_at_end = max(0, lost.total() - self._gaps)

    def _records(self, opcode: int, content: bytes) -> list[McapRecord]:
        try:
            if opcode == DAMAGE:
                self._loss.damaged_records += 1
                self._chunk_is_read = False  # it may have been a chunk, or an index of the one before
            elif opcode == Opcode.CHUNK:
                self._last_chunk, self._chunk_is_read = [], False  # until it is read
                return self._chunk(content)
            elif opcode == Opcode.MESSAGE_INDEX and not self._chunk_is_read:
                index = MessageIndex.read(ReadDataStream(BytesIO(content)))
                times = [stamp_ns for stamp_ns, _ in index.records]
                if times != self._times_in_last_chunk(index.channel_id):
                    self._indexed[index.channel_id] += len(times)  # of a chunk that could not be read
            elif opcode == Opcode.ATTACHMENT:
                self._loss.damaged_files += stored_file(content) is None
            elif opcode == Opcode.METADATA:
                found = Metadata.read(ReadDataStream(BytesIO(content)))
                self.end = found.metadata if found.name == END_RECORD else self.end
            elif opcode == Opcode.CHANNEL:  # of the summary: names what damaged chunks described
                channel = Channel.read(ReadDataStream(BytesIO(content)))
                self._topics.setdefault(channel.id, channel.topic)
        except UNREADABLE:
            self._loss.damaged_chunks += opcode == Opcode.CHUNK
        return []

    def _chunk(self, content: bytes) -> list[McapRecord]:
        self._last_chunk = split_chunk(Chunk.read(ReadDataStream(BytesIO(content))), self._is_wanted)
        self._chunk_is_read = True
        return self._last_chunk

    def _is_wanted(self, channel: Channel) -> bool:
        return self._wanted is None or channel.topic in self._wanted

    def _times_in_last_chunk(self, channel: int) -> list[int]:
        messages = (record for record in self._last_chunk if isinstance(record, Message))
        return [message.log_time for message in messages if message.channel_id == channel]


def stored_file(content: bytes) -> Attachment | None:
    """A file that is stored in a recording, by its record's content; None if it is not as it was by its checksum."""
    (checksum,) = struct.unpack("<I", content[-4:].rjust(4, b"\0"))
    if checksum not in (0, zlib.crc32(content[:-4])):  # 0: there is none
        return None
    try:
        found: Attachment = Attachment.read(ReadDataStream(BytesIO(content)))
    except UNREADABLE:
        return None
    return found


def open_segment(path: Path) -> BinaryIO:
    """Open a file of a recording. Raises SessionDataError."""
    try:
        return open_plain(path)
    except OSError as error:
        raise SessionDataError(
            f"cannot be opened ({error.strerror})", where=str(path), hint="Check the session folder"
        ) from error
