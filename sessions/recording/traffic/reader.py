"""Reading a traffic file, complete or damaged.

A truncated file (killed process, full disk, power cut) has no summary, and its last record may be incomplete. Every
complete chunk is read, and :attr:`TrafficReader.loss` says what was not. A chunk that was damaged on disk is skipped
and counted; the chunks after it are read, since each describes its own topics. A recording in several files is read as
one. Recordings of older versions are converted while they are read (see :mod:`sessions.recording.traffic.formats`).
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Attachment, Header, Message, Metadata

from drivers.core.errors import SessionDataError
from drivers.core.reading.bounded_files import open_plain
from sessions.recording.traffic import formats, raw_frames, schemas
from sessions.recording.traffic.files import PROFILE, SEAL, is_sealed, segment_path
from sessions.recording.traffic.loss import Loss
from sessions.recording.traffic.mcap_frames import DAMAGE, Frames
from sessions.recording.traffic.mcap_summary import read_summary
from sessions.recording.traffic.raw_frames import UNSTAMPED, DeviceStamp
from sessions.recording.traffic.segment import UNREADABLE, SegmentMessages, open_segment, stored_file
from sessions.recording.traffic.tail import read_tail


@dataclass(frozen=True)
class TrafficMessage:
    """One message: topic, bytes, its own stamp (session clock), its number in the file, the device's own stamp."""

    topic: str
    data: bytes
    stamp_ns: int
    sequence: int
    device: DeviceStamp = UNSTAMPED


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
            segment = SegmentMessages(path, self.loss, expected, self._resumed if path == self.path else {})
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

    def messages_on(self, topics: Collection[str]) -> Iterator[TrafficMessage]:
        """The readable messages on these topics, from the beginning: several times faster than all.

        It tells nothing of what could not be read, and leaves :attr:`loss` and :attr:`end` as they are.
        """
        if read_tail(self.path):  # of a session that runs or was killed: what is new in it shows by the numbers of all
            yield from (message for message in TrafficReader(self.path).messages() if message.topic in topics)
            return
        for path in segment_paths(self.path):
            resumed = self._resumed if path == self.path else {}
            for topic, message in SegmentMessages(path, Loss(), 0, resumed, topics):
                if topic is not None and topic in topics:
                    yield self._as_now(topic, message)

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
        """The files stored inside the recording that are as they were. Raises SessionError."""
        with open_segment(self.path) as file:
            for opcode, content in Frames(file):
                if opcode == Opcode.CHUNK:
                    return
                if opcode == Opcode.ATTACHMENT and (stored := stored_file(content)) is not None:
                    yield stored

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
        with open_segment(path) as file:
            frames = Frames(file, read_summary(file).landmarks, self._resumed)
            begun = False
            for opcode, content in frames:
                begun = begun or opcode not in (DAMAGE, Opcode.HEADER)
                if opcode == Opcode.CHUNK:
                    break
                with suppress(*UNREADABLE):
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
        with open_plain(path) as file:
            summary = make_reader(file).get_summary()
    except (OSError, *UNREADABLE):
        return True  # whoever reads it will find out
    return summary is None or any(channel.topic in topics for channel in summary.channels.values())
