"""The last moments of a recording, in memory that outlives the program.

Chunks wait up to 80 ms before they reach the file, and on a busy machine the thread that writes them waits for its turn
as well. So each message is also copied at once into a ring of a few megabytes in shared memory, where no disk can delay
it. It is there when the program was killed, until the machine is switched off. The recording's folder has a link to it,
which goes when the recording is complete; rings whose folder is gone are removed when the next recording begins.
"""

from __future__ import annotations

import fcntl
import mmap
import os
import stat
import struct
import tempfile
import time
import zlib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

TAIL_BYTES = 4 << 20
"""At full load two seconds and a half: as long as the disk may stand still before a kill costs anything."""

_SHARED = Path("/dev/shm")
_PREFIX = "tactile-lab-"
_MARK = b"\x1dtail\xa1"
_FRAME = struct.Struct("<6sII")  # mark, bytes of all, checksum of what follows
_FACTS = struct.Struct("<IqqH")  # sequence, log time, stamp, bytes of the topic
_HEAD_BYTES = 4096
"""Before the messages: the path of the link."""

_YOUNG_s = 60.0


class TailMessage(NamedTuple):
    """A message as it would stand in the file: topic, number, log time and own stamp, content."""

    topic: str
    sequence: int
    log_ns: int
    stamp_ns: int
    data: bytes


def tail_path(recording: Path) -> Path:
    """The link to a recording's tail."""
    return recording.with_suffix(".tail")


class NullTail:
    """Keeps nothing: for copies, and where there is no shared memory."""

    def append(self, message: TailMessage) -> None:
        """Nothing."""

    def close(self, complete: bool) -> None:
        """Nothing."""


class Tail(NullTail):
    """The ring of one recording.

    Args:
        recording: its first file; the link is created next to it.
        size: of the ring, bytes.

    Raises:
        OSError: there is no shared memory, or no room in it.
    """

    def __init__(self, recording: Path, size: int = TAIL_BYTES) -> None:
        self._descriptor, name = tempfile.mkstemp(".tail", _PREFIX, _SHARED)
        self._file, self._link, self._size, self._next = Path(name), tail_path(recording.absolute()), size, 0
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX)
            os.posix_fallocate(self._descriptor, 0, _HEAD_BYTES + size)  # else a full memory ends us by a signal
            self._ring = mmap.mmap(self._descriptor, _HEAD_BYTES + size)
            self._ring[:_HEAD_BYTES] = os.fsencode(self._link).ljust(_HEAD_BYTES, b"\0")[:_HEAD_BYTES]
            self._link.symlink_to(self._file)
        except BaseException:
            self._file.unlink(missing_ok=True)
            os.close(self._descriptor)
            raise

    def append(self, message: TailMessage) -> None:
        """Copy a message over the oldest ones; one larger than the ring is left out."""
        topic = message.topic.encode()
        facts = _FACTS.pack(message.sequence, message.log_ns, message.stamp_ns, len(topic))
        rest = b"".join((facts, topic, message.data))
        length = _FRAME.size + len(rest)
        if length > self._size:
            return
        begin = self._next if self._next + length <= self._size else 0
        self._next = begin + length
        frame = _FRAME.pack(_MARK, length, zlib.crc32(rest))
        self._ring[_HEAD_BYTES + begin : _HEAD_BYTES + self._next] = frame + rest

    def close(self, complete: bool) -> None:
        """Let go of it; it is removed if the recording is complete."""
        self._ring.close()
        os.close(self._descriptor)
        if complete:
            _remove(self._link)
            _remove(self._file)


def open_tail(recording: Path) -> NullTail:
    """The ring of a new recording; none where there is no shared memory, which costs a killed session 100 ms."""
    with suppress(OSError):
        _remove_orphans()
    try:
        return Tail(recording)
    except OSError:
        return NullTail()


def _remove_orphans() -> None:
    """Remove rings that nobody writes and whose link is gone, with the folder that it was in. Raises OSError."""
    for ring in _SHARED.glob(f"{_PREFIX}*.tail"):
        with suppress(OSError), ring.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            found = os.fstat(file.fileno())
            link = Path(os.fsdecode(file.read(_HEAD_BYTES).rstrip(b"\0")))
            old = time.time() - found.st_mtime > _YOUNG_s  # a new one may have no link yet
            if found.st_uid == os.getuid() and old and not link.is_symlink():
                _remove(ring)


def _remove(path: Path) -> None:
    with suppress(OSError):
        path.unlink(missing_ok=True)


def read_tail(recording: Path) -> list[TailMessage]:
    """The messages in the tail of a recording that was cut off, in the order of their numbers; none if it has no tail.

    Only a ring of this user's in shared memory is read, whatever the link says.
    """
    try:
        place = tail_path(recording).readlink()
        if place.parent != _SHARED or not place.name.startswith(_PREFIX):
            return []
        with os.fdopen(os.open(place, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as file:
            found = os.fstat(file.fileno())
            if not stat.S_ISREG(found.st_mode) or found.st_uid != os.getuid() or found.st_size > 16 * TAIL_BYTES:
                return []
            content = file.read()
    except OSError:
        return []
    return sorted(_messages(content[_HEAD_BYTES:]), key=lambda message: (message.log_ns, message.sequence))


def _messages(content: bytes) -> Iterator[TailMessage]:
    """All that is whole; what was half overwritten is not."""
    place = content.find(_MARK)
    while place >= 0:
        message, end = _message(content, place)
        if message is not None:
            yield message
        place = content.find(_MARK, end)


def _message(content: bytes, place: int) -> tuple[TailMessage | None, int]:
    """The message at a mark and where it ends; None and the next byte if there is none."""
    begin = place + _FRAME.size
    if begin + _FACTS.size > len(content):
        return None, place + 1
    _, length, checksum = _FRAME.unpack_from(content, place)
    rest = content[begin : place + length]
    if len(rest) < _FACTS.size or zlib.crc32(rest) != checksum:
        return None, place + 1
    sequence, log_ns, stamp_ns, topic_bytes = _FACTS.unpack_from(rest)
    topic, data = rest[_FACTS.size :][:topic_bytes], rest[_FACTS.size + topic_bytes :]
    return TailMessage(topic.decode(), sequence, log_ns, stamp_ns, data), place + length
