"""Reading a traffic file, complete or damaged.

A truncated file (killed process, full disk, power cut) has no summary, and its last record may be incomplete. Every
complete chunk is read, and :attr:`TrafficReader.loss` says what was not. A chunk that was damaged on disk is skipped
and counted; the chunks after it are read, each by itself: it describes what is in it. A recording in several
files is read as one. Recordings of older versions are
converted while they are read (see
:mod:`sessions.recording.traffic.formats`).
"""

from __future__ import annotations

import json
import re
import struct
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, Chunk, Header, McapRecord, Message, MessageIndex, Metadata

from drivers.core.errors import SessionDataError
from sessions.recording.traffic import formats, raw_frames, schemas
from sessions.recording.traffic.files import END_RECORD, PROFILE, SEAL, is_sealed, segment_path
from sessions.recording.traffic.mcap_chunks import split_chunk
from sessions.recording.traffic.mcap_frames import DAMAGE, Frames
from sessions.recording.traffic.mcap_summary import Summary, read_summary
from sessions.recording.traffic.raw_frames import UNSTAMPED, DeviceStamp
from sessions.recording.traffic.tail import read_tail

_UNREADABLE = (McapError, zstandard.ZstdError, struct.error, ValueError, OverflowError, MemoryError)
"""What the mcap package raises on damaged content."""


@dataclass(frozen=True)
class TrafficMessage:
    """One message: topic, bytes, its own stamp (session clock), its number in the file, the device's own stamp."""

    topic: str
    data: bytes
    stamp_ns: int
    sequence: int
    device: DeviceStamp = UNSTAMPED


@dataclass
class Loss:
    """What could not be read.

    Attributes:
        truncated: the file ends too early; up to the last tenth of a second was not written.
        unreadable_bytes: bytes after the last complete record.
        damaged_chunks: chunks skipped.
        damaged_records: places where no record begins though one should; reading goes on at the next one.
        missing_messages: gaps in the numbering of what was read.
        by_topic: messages missing by topic: in a whole file by its summary, else those of damaged chunks whose index
            could be read; part of ``missing_messages``.
    """

    truncated: bool = False
    unreadable_bytes: int = 0
    damaged_chunks: int = 0
    damaged_records: int = 0
    missing_messages: int = 0
    by_topic: dict[str, int] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return self.truncated or self.damaged_chunks > 0 or self.damaged_records > 0 or self.missing_messages > 0

    def describe(self) -> str:
        """The loss in words; empty if nothing was lost."""
        parts = []
        if self.truncated:
            torn = f" ({self.unreadable_bytes} bytes of an incomplete record)" if self.unreadable_bytes else ""
            parts.append(f"the file ends too early{torn}")
        if self.damaged_chunks:
            parts.append(f"{self.damaged_chunks} damaged chunks skipped")
        if self.damaged_records:
            parts.append(f"damaged in {self.damaged_records} more places ({self.unreadable_bytes} bytes)")
        if self.missing_messages:
            parts.append(f"{self.missing_messages} messages missing")
        return "; ".join(parts)

    def counts(self) -> dict[str, int]:
        """The loss as counts by kind, for a session's manifest; empty if nothing was lost."""
        kinds = {
            "truncated": int(self.truncated),
            "unreadable_bytes": self.unreadable_bytes,
            "damaged_chunks": self.damaged_chunks,
            "damaged_records": self.damaged_records,
            "missing_messages": self.missing_messages,
        }
        return {kind: number for kind, number in kinds.items() if number}


class TrafficReader:
    """Streams the messages of a recording in the order in which they happened.

    Args:
        path: of its first file; the following files are in the same folder.

    Raises:
        SessionError: the file is missing, not an MCAP file, not one of a session, or of an unknown version.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.info: dict[str, str] = {}
        """The writer's facts about the session."""
        self.end: dict[str, str] = {}
        """The writer's facts at the end; complete once :meth:`messages` has been read to the end."""
        self.loss = Loss()
        """Complete once :meth:`messages` has been read to the end."""
        self._resumed: dict[tuple[int, int], int | None] = {}
        self._convert = self._read_preamble(path)

    def messages(self) -> Iterator[TrafficMessage]:
        """All readable messages, from the beginning."""
        self.loss, self.end, expected = Loss(), {}, 0
        for path in segment_paths(self.path):
            segment = _SegmentMessages(path, self.loss, expected, self._resumed if path == self.path else {})
            for topic, message in segment:
                self.loss.missing_messages += (message.sequence - expected) & 0xFFFFFFFF
                expected = message.sequence + 1
                if topic is None:  # its description was in a damaged chunk
                    self.loss.missing_messages += 1
                    continue
                yield self._as_now(topic, message)
            self.loss.missing_messages += segment.lost_at_end
            expected += segment.lost_at_end
            self.end = segment.end
        if not self.end:
            yield from self._tail(expected)
        self.loss.truncated |= not self.end and self.info.get("format") != formats.TRAFFIC_FORMATS[0]

    def _tail(self, expected: int) -> Iterator[TrafficMessage]:
        """Of a recording that was cut off: the messages behind those of its file that are still in shared memory."""
        for last in read_tail(self.path):
            gap = (last.sequence - expected) & 0xFFFFFFFF
            if gap < 1 << 31:  # else it is in the file
                self.loss.missing_messages += gap
                expected = last.sequence + 1
                yield self._as_now(last.topic, Message(0, last.log_ns, last.data, last.stamp_ns, last.sequence))

    def streams(self) -> dict[str, dict[str, int]]:
        """The writer's counts of each stream, from its record at the end; empty if there is none."""
        try:
            found = json.loads(self.end.get("streams", "{}"))
        except ValueError:
            return {}
        return found if isinstance(found, dict) else {}

    def attachments(self) -> Iterator[Attachment]:
        """The files stored inside the recording. Raises SessionError."""
        with _open(self.path) as file:
            for opcode, content in Frames(file):
                if opcode == Opcode.CHUNK:
                    return
                if opcode == Opcode.ATTACHMENT:
                    try:
                        yield Attachment.read(ReadDataStream(BytesIO(content)))
                    except _UNREADABLE as error:
                        raise SessionDataError(f"an attachment is damaged ({error})", where=str(self.path)) from error

    def _as_now(self, topic: str, message: Message) -> TrafficMessage:
        """A message in the present format, without its envelope."""
        topic, data, stamp_ns = self._convert((topic, message.data, message.publish_time))
        if not schemas.is_raw(topic):
            return TrafficMessage(topic, data, stamp_ns, message.sequence)
        try:
            payload, device = raw_frames.decode(data)
        except ValueError as error:
            raise SessionDataError(f"a message of {topic} cannot be read ({error})", where=str(self.path)) from error
        return TrafficMessage(topic, payload, stamp_ns, message.sequence, device)

    def _read_preamble(self, path: Path) -> Callable[[formats.Message], formats.Message]:
        """What the header and the writer's own notes say; these stand there twice, in case one is damaged."""
        notes: list[dict[str, str]] = []
        profile: str | None = None
        with _open(path) as file:
            frames = Frames(file, read_summary(file).landmarks, self._resumed)
            begun = False
            for opcode, content in frames:
                begun = begun or opcode not in (DAMAGE, Opcode.HEADER)
                if opcode == Opcode.CHUNK:
                    break
                with suppress(*_UNREADABLE):
                    if opcode == Opcode.HEADER:
                        profile = Header.read(ReadDataStream(BytesIO(content))).profile
                    elif opcode == Opcode.METADATA:
                        found = Metadata.read(ReadDataStream(BytesIO(content)))
                        notes += [found.metadata] if found.name == PROFILE else []
            if frames.damaged_magic and not (notes or profile == PROFILE):
                raise SessionDataError(
                    "not an MCAP file", where=str(path), hint="Restore it from a copy of the session"
                )
        if not notes:
            if profile is not None:
                self._check_profile(profile)
            # torn before it says anything; else of the first version
            return formats.traffic_converter(None if begun else formats.TRAFFIC_FORMATS[-1], str(path))
        self.info = dict(next((note for note in notes if is_sealed(note)), notes[0]))
        self.info.pop(SEAL, None)
        return formats.traffic_converter(self.info.get("format"), str(path))

    def _check_profile(self, profile: str) -> None:
        if profile != PROFILE:
            raise SessionDataError(
                f"an MCAP file, but not one of a session (its profile is {profile!r}, not {PROFILE!r})",
                where=str(self.path),
                hint="Restore the session's own traffic.mcap",
            )


def segment_paths(path: Path) -> list[Path]:
    """The files of a recording in order; a gap in their numbers shows as missing messages."""
    numbered = re.compile(rf"{re.escape(path.stem)}-([1-9][0-9]{{0,8}}){re.escape(path.suffix)}")
    numbers = [int(found[1]) for item in path.parent.glob("*") if (found := numbered.fullmatch(item.name))]
    return [path, *(segment_path(path, number) for number in sorted(numbers) if number > 1)]


class _SegmentMessages:
    """The messages of one file with their topics (None if unknown)."""

    def __init__(self, path: Path, loss: Loss, expected: int, resumed: dict[tuple[int, int], int | None]) -> None:
        self.end: dict[str, str] = {}
        self.lost_at_end = 0
        """Messages lost behind the last one read, by summary or index: no gap in the numbering shows them."""
        self._path, self._loss, self._resumed = path, loss, resumed
        self._topics: dict[int, str] = {}
        self._read: Counter[int] = Counter()
        self._indexed: Counter[int] = Counter()
        self._last_chunk: list[McapRecord] = []
        self._chunk_is_read = False
        self._gaps, self._expected = 0, expected

    def __iter__(self) -> Iterator[tuple[str | None, Message]]:
        with _open(self._path) as file:
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
            self._tell_lost(summary)

    def _note(self, message: Message) -> None:
        self._read[message.channel_id] += 1
        self._gaps += (message.sequence - self._expected) & 0xFFFFFFFF
        self._expected = message.sequence + 1

    def _tell_lost(self, summary: Summary) -> None:
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
            elif opcode == Opcode.METADATA:
                found = Metadata.read(ReadDataStream(BytesIO(content)))
                self.end = found.metadata if found.name == END_RECORD else self.end
            elif opcode == Opcode.CHANNEL:  # of the summary: names what damaged chunks described
                channel = Channel.read(ReadDataStream(BytesIO(content)))
                self._topics.setdefault(channel.id, channel.topic)
        except _UNREADABLE:
            self._loss.damaged_chunks += opcode == Opcode.CHUNK
        return []

    def _chunk(self, content: bytes) -> list[McapRecord]:
        self._last_chunk = split_chunk(Chunk.read(ReadDataStream(BytesIO(content))))
        self._chunk_is_read = True
        return self._last_chunk

    def _times_in_last_chunk(self, channel: int) -> list[int]:
        messages = (record for record in self._last_chunk if isinstance(record, Message))
        return [message.log_time for message in messages if message.channel_id == channel]


def _open(path: Path) -> BinaryIO:
    try:
        return path.open("rb")
    except OSError as error:
        raise SessionDataError(
            f"cannot be opened ({error.strerror})", where=str(path), hint="Check the session folder"
        ) from error


def may_hold(path: Path, topics: Collection[str]) -> bool:
    """Whether a recording may hold a message of one of these topics.

    Args:
        path: of its first file.
        topics: to look for.

    Returns:
        False only if every file of it has a summary without these topics.
    """
    return any(_names_one(segment, topics) for segment in segment_paths(path))


def _names_one(path: Path, topics: Collection[str]) -> bool:
    try:
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
    except (OSError, McapError, ValueError):
        return True  # whoever reads it will find out
    return summary is None or any(channel.topic in topics for channel in summary.channels.values())
