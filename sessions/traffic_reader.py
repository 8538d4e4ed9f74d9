"""Reading a traffic file, whole or torn.

A file that was cut off (killed process, full disk, power cut) has no summary, and its last record may be torn. Every
complete chunk is read, and :attr:`TrafficReader.loss` says what was not. A chunk that was damaged on the disk is left
out and counted; the chunks after it are read.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Header, McapRecord, Message, Metadata
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC

from sessions.traffic import FORMAT, PROFILE
from tactile_lab.errors import SessionError

_FRAME = struct.Struct("<BQ")
_UNREADABLE = (McapError, zstandard.ZstdError, struct.error, ValueError, OverflowError, MemoryError)
"""What the mcap package raises on damaged content."""


@dataclass(frozen=True)
class TrafficMessage:
    """One message: topic, bytes, its own stamp (session clock) and its number in the file."""

    topic: str
    data: bytes
    stamp_ns: int
    sequence: int


@dataclass
class Loss:
    """What could not be read.

    Attributes:
        truncated: the file ends too early; up to 100 ms of traffic before the end was never written.
        unreadable_bytes: bytes after the last complete record.
        damaged_chunks: chunks left out.
        missing_messages: gaps in the numbering of what was read.
    """

    truncated: bool = False
    unreadable_bytes: int = 0
    damaged_chunks: int = 0
    missing_messages: int = 0

    def __bool__(self) -> bool:
        return self.truncated or self.damaged_chunks > 0 or self.missing_messages > 0

    def describe(self) -> str:
        """The loss in words; empty when nothing was lost."""
        parts = []
        if self.truncated:
            torn = f" ({self.unreadable_bytes} bytes of an incomplete record)" if self.unreadable_bytes else ""
            parts.append(f"the file ends too early{torn}")
        if self.damaged_chunks:
            parts.append(f"{self.damaged_chunks} damaged chunks left out")
        if self.missing_messages:
            parts.append(f"{self.missing_messages} messages missing")
        return "; ".join(parts)

    def counts(self) -> dict[str, int]:
        """The loss as numbers by kind, for a session's record; empty when nothing was lost."""
        return {kind: int(number) for kind, number in asdict(self).items() if number}


class TrafficReader:
    """Streams the messages of a traffic file in the order in which they happened.

    Raises:
        SessionError: the file is missing, no MCAP file, or not one of a session.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.info: dict[str, str] = {}
        """What the writer noted about the session."""
        self.loss = Loss()
        """Complete once :meth:`messages` has been read to the end."""
        with self._open() as file:
            self._read_preamble(_Frames(file))

    def messages(self) -> Iterator[TrafficMessage]:
        """All messages that can be read, from the beginning."""
        self.loss = Loss()
        channels: dict[int, str] = {}
        expected = 0
        with self._open() as file:
            frames = _Frames(file)
            for record in self._records(frames):
                if isinstance(record, Channel):
                    channels[record.id] = record.topic
                elif isinstance(record, Message):
                    self.loss.missing_messages += (record.sequence - expected) & 0xFFFFFFFF
                    expected = record.sequence + 1
                    if record.channel_id not in channels:  # its description was in a damaged chunk
                        self.loss.missing_messages += 1
                        continue
                    topic = channels[record.channel_id]
                    yield TrafficMessage(topic, record.data, record.publish_time, record.sequence)
            self.loss.truncated, self.loss.unreadable_bytes = not frames.complete, frames.unreadable_bytes

    def _records(self, frames: _Frames) -> Iterator[McapRecord]:
        for opcode, content in frames:
            if opcode != Opcode.CHUNK:
                continue
            try:
                records = breakup_chunk(Chunk.read(ReadDataStream(BytesIO(content))), validate_crc=True)
            except _UNREADABLE:
                self.loss.damaged_chunks += 1
            else:
                yield from records

    def _open(self) -> BinaryIO:
        try:
            return self.path.open("rb")
        except OSError as error:
            raise SessionError(
                f"can not be opened ({error.strerror})", where=str(self.path), hint="Check the session folder"
            ) from error

    def _read_preamble(self, frames: _Frames) -> None:
        if not frames.is_mcap:
            raise SessionError("not an MCAP file", where=str(self.path), hint="Restore it from a copy of the session")
        try:
            for opcode, content in frames:
                stream = ReadDataStream(BytesIO(content))
                if opcode == Opcode.HEADER:
                    self._check_profile(Header.read(stream).profile)
                elif opcode == Opcode.METADATA:
                    self._check_format(Metadata.read(stream).metadata)
                    return
                else:
                    self._check_format({})
        except _UNREADABLE as error:
            raise SessionError(f"its beginning is damaged ({error})", where=str(self.path)) from error

    def _check_profile(self, profile: str) -> None:
        if profile != PROFILE:
            raise SessionError(
                f"an MCAP file, but not one of a session (its profile is {profile!r}, not {PROFILE!r})",
                where=str(self.path),
                hint="Restore the session's own traffic.mcap",
            )

    def _check_format(self, metadata: dict[str, str]) -> None:
        self.info = metadata
        if metadata.get("format") != FORMAT:
            raise SessionError(
                f"written in the form {metadata.get('format')!r}; this version reads {FORMAT!r}",
                where=str(self.path),
                hint="Use the version that recorded it",
            )


class _Frames:
    """Iterates over the records of an MCAP file, torn or not, as opcode and content."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._size = file.seek(0, 2)
        file.seek(0)
        magic = file.read(len(MCAP0_MAGIC))
        self.is_mcap = MCAP0_MAGIC.startswith(magic)
        self.complete = False
        """The closing magic was reached."""
        self.unreadable_bytes = 0

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        while not self.complete:
            start = self._file.tell()
            opcode, content = self._next()
            if content is None:
                self.unreadable_bytes = self._size - start
                return
            yield opcode, content
            if opcode == Opcode.FOOTER:
                self.complete = self._file.read() == MCAP0_MAGIC
                self.unreadable_bytes = 0 if self.complete else self._size - start - _FRAME.size - len(content)
                return

    def _next(self) -> tuple[int, bytes | None]:
        head = self._file.read(_FRAME.size)
        if len(head) < _FRAME.size:
            return 0, None
        opcode, length = _FRAME.unpack(head)
        if length > self._size - self._file.tell():
            return opcode, None
        return opcode, self._file.read(length)
