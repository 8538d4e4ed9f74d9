"""Records of ATI's stand-alone F/T controller on RS-232, in its two output forms (protocols: F/T controller)."""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass

from drivers.core.errors import CodecError

PROMPT = b">"
TERMINATOR = b"\x06\r\n>"
"""The prompt that ends an answer in binary mode."""

_BINARY = struct.Struct(">B6h")
_ASCII = re.compile(rb"\s*(\d{1,3})" + rb"\s*,\s*(-?\d{1,6})" * 6 + rb"\s*")
_ECHOES = (b"", b"QR", b"QS", b"QR\r", b"QS\r", b"QR\r\n", b"QS\r\n")
_LONGEST = 4096


@dataclass(frozen=True)
class Record:
    """One resolved record: force x, y, z, torque x, y, z in counts; ``error`` is 0 if the record is valid."""

    error: int
    counts: tuple[int, ...]


def encode_binary(record: Record) -> bytes:
    """The 13 bytes of a record. Raises CodecError when a count does not fit."""
    try:
        return _BINARY.pack(record.error, *record.counts)
    except struct.error as error:
        raise CodecError(f"{record} does not fit 13 bytes", where="F/T controller") from error


def decode_binary(payload: bytes) -> Record:
    """Decode a record of 13 bytes. Raises CodecError for another length."""
    if len(payload) != _BINARY.size:
        raise CodecError(f"{len(payload)} bytes instead of the {_BINARY.size} of a record", where="F/T controller")
    error, *counts = _BINARY.unpack(payload)
    return Record(error, tuple(counts))


def encode_ascii(record: Record) -> bytes:
    """A record as a line with its line end. Raises CodecError unless there are six counts."""
    if len(record.counts) != 6:
        raise CodecError(f"{len(record.counts)} counts instead of six", where="F/T controller")
    return (f"{record.error}," + ",".join(f"{count:6d}" for count in record.counts) + "\r\n").encode("ascii")


def decode_ascii(line: bytes) -> Record:
    """Decode a line without its line end. Raises CodecError if it is not a record."""
    if (match := _ASCII.fullmatch(line)) is None:
        raise CodecError(f"{line[:60]!r} is not a record", where="F/T controller")
    error, *counts = (int(word) for word in match.groups())
    return Record(error, tuple(counts))


class AsciiLines:
    """Splits received bytes into records. Prompts and echoes are skipped; damaged lines are counted."""

    def __init__(self) -> None:
        self.damaged = 0
        self._buffer = b""

    def feed(self, piece: bytes) -> list[Record]:
        """The records that are now complete, oldest first."""
        *lines, self._buffer = (self._buffer + piece).split(b"\n")
        self._buffer = self._buffer[-_LONGEST:]
        return [record for line in lines if (record := self._record(line.strip(b"\r> "))) is not None]

    def _record(self, line: bytes) -> Record | None:
        try:
            return decode_ascii(line)
        except CodecError:
            self.damaged += b"," in line
            return None


class BinaryAnswers:
    """Splits received bytes into the records between prompts; records of a wrong length are counted."""

    def __init__(self) -> None:
        self.damaged = 0
        self._buffer = b""

    def feed(self, piece: bytes) -> list[Record]:
        """The records that are now complete, oldest first."""
        *answers, self._buffer = (self._buffer + piece).split(TERMINATOR)
        self._buffer = self._buffer[-_LONGEST:]
        return [record for answer in answers if (record := self._record(answer)) is not None]

    def _record(self, answer: bytes) -> Record | None:
        echo, payload = answer[: -_BINARY.size], answer[-_BINARY.size :]
        if len(payload) == _BINARY.size and echo.rpartition(PROMPT)[2] in _ECHOES:  # prompts left over from the set-up
            return decode_binary(payload)
        self.damaged += answer.startswith((b"Q", b"\0"))
        return None
