"""The records of an MCAP file one after another: whole, torn, or with damage in it.

A record's length says where the next one begins, so that one wrong bit in it would hide all that follows. Chunks and
message indices state their length twice, the summary lists the place of every chunk, and without a summary chunks are
found by how they begin: after damage reading continues at the next record.
"""

from __future__ import annotations

import re
import struct
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from drivers.core.reading.bounded_files import open_plain

_FRAME = struct.Struct("<BQ")
_CHUNK_HEAD = struct.Struct("<QQQII")  # begins, ends, bytes unpacked, checksum, length of what follows: the packing
_CHUNK_BYTES = _CHUNK_HEAD.size + len(b"zstd") + 8  # of a chunk besides its records
_MESSAGE_BYTES = 22  # of a message besides its data
_TEXT, _LONG = struct.Struct("<I"), struct.Struct("<Q")  # lengths of a text and of an attachment
_OPCODES = frozenset(range(Opcode.HEADER, Opcode.DATA_END + 1))
_BLOCK_BYTES = 1 << 20
_CHUNK_MARK = b"\x04\x00\x00\x00zstd"
_AHEAD_BYTES = _FRAME.size + _CHUNK_HEAD.size + len(_CHUNK_MARK)
_CANDIDATES = re.compile(rb"\x06(?=.{40}zstd)|\x07(?=.{4}\x00{4})|\x0c(?=.{8}\x0b\x00\x00\x00tactile-lab)", re.DOTALL)
"""How chunks, message indices, and what a writer noted about a session begin."""

DAMAGE = 0
"""Instead of an opcode: here something could not be read."""


def ends_well(path: Path) -> bool:
    """Whether a file ends like a finished MCAP file; nothing else is checked. Raises OSError."""
    with open_plain(path) as file:
        size = file.seek(0, 2)
        file.seek(max(0, size - len(MCAP0_MAGIC)))
        return file.read() == MCAP0_MAGIC


class Frames:
    """Iterates over the records of an MCAP file, truncated or not, as opcode and content; :data:`DAMAGE` between them.

    Args:
        file: from its beginning.
        landmarks: offsets at which records are known to begin, by the file's summary; ascending.
        resumed: where reading went on after damage, by offset and size of the file: who reads it twice searches once.
    """

    def __init__(
        self,
        file: BinaryIO,
        landmarks: Sequence[int] = (),
        resumed: dict[tuple[int, int], int | None] | None = None,
    ) -> None:
        self._file, self._landmarks = file, landmarks
        self._resumed = {} if resumed is None else resumed
        self._size = file.seek(0, 2)
        file.seek(0)
        magic = file.read(len(MCAP0_MAGIC))
        self.damaged_magic = not MCAP0_MAGIC.startswith(magic)
        """It does not begin as an MCAP file does, or as the beginning of one."""
        self.complete = False
        """Whether the closing magic was reached."""
        self.unreadable_bytes = 0

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        start = len(MCAP0_MAGIC)
        while not self.complete:
            self._file.seek(start)
            opcode, end = self._record(start)
            if end is None:
                place = start + 1, self._size
                if place not in self._resumed:
                    self._resumed[place] = self._resume(start + 1)
                following = self._resumed[place]
                self.unreadable_bytes += (self._size if following is None else following) - start
                if following is None:
                    return
                yield DAMAGE, b""
                start = following
                continue
            content = self._read(start + _FRAME.size, end)
            yield opcode, content
            if opcode == Opcode.FOOTER:
                self._file.seek(end)
                self.complete = self._file.read() == MCAP0_MAGIC
                self.unreadable_bytes += 0 if self.complete else self._size - end
                return
            start = end

    def _record(self, start: int) -> tuple[int, int | None]:
        """Opcode and end of the record at an offset; no end where it is none, or torn."""
        head = self._read(start, start + _FRAME.size)
        if len(head) < _FRAME.size:
            return DAMAGE, None
        opcode, length = _FRAME.unpack(head)
        end = start + _FRAME.size + length
        if opcode not in _OPCODES:
            return opcode, None
        if opcode == Opcode.CHUNK and end != (told := self._chunk_end(start)):
            end = told if told is not None and self._begins(told) else end
            if not self._begins(end):
                return opcode, None
        if not self._agrees(opcode, start + _FRAME.size, length):
            return opcode, None
        place = bisect_right(self._landmarks, start)
        passed = place < len(self._landmarks) and self._landmarks[place] < end
        return opcode, None if passed or end > self._size else end

    def _chunk_end(self, start: int) -> int | None:
        """Where a chunk ends by the length of its records; None where it is packed otherwise, or torn there."""
        content = self._read(start + _FRAME.size, start + _FRAME.size + _CHUNK_BYTES)
        if len(content) < _CHUNK_BYTES or content[_CHUNK_HEAD.size : -8] != b"zstd":
            return None
        (length,) = struct.unpack_from("<Q", content, _CHUNK_BYTES - 8)
        return start + _FRAME.size + _CHUNK_BYTES + int(length)

    def _agrees(self, opcode: int, start: int, length: int) -> bool:
        """Whether the lengths inside of a record's content come to its own; of kinds without any, always.

        Messages without even a stamp would be millions to a file that has nothing in it.
        """
        if opcode == Opcode.MESSAGE:
            return length >= _MESSAGE_BYTES
        if opcode == Opcode.HEADER:
            filled = self._past_text(self._past_text(start))
        elif opcode == Opcode.MESSAGE_INDEX:
            filled = self._past_text(start + 2)
        elif opcode == Opcode.METADATA:
            filled = self._past_text(self._past_text(start))
        elif opcode == Opcode.ATTACHMENT:
            data = self._past_text(self._past_text(start + 2 * _LONG.size))
            filled = data + _LONG.size + self._number(_LONG, data) + _TEXT.size  # and the checksum
        else:
            return True
        return filled == start + length

    def _past_text(self, start: int) -> int:
        """The offset behind a text, or whatever else has its length before it."""
        return start + _TEXT.size + self._number(_TEXT, start)

    def _number(self, form: struct.Struct, start: int) -> int:
        content = self._read(start, start + form.size)
        return int(form.unpack(content)[0]) if len(content) == form.size else 0

    def _begins(self, offset: int) -> bool:
        """Whether a record may begin there, or the file ends."""
        if offset == self._size:
            return True
        head = self._read(offset, offset + _FRAME.size)
        if len(head) < _FRAME.size:
            return offset < self._size and not head.strip(b"\0")
        opcode, length = _FRAME.unpack(head)
        return opcode in _OPCODES and length <= self._size - offset

    def _resume(self, start: int) -> int | None:
        """Where reading continues after damage at or behind an offset; None at the end of the file."""
        place = bisect_right(self._landmarks, start - 1)
        landmark = self._landmarks[place] if place < len(self._landmarks) else None
        found = self._search(start, self._size if landmark is None else landmark)
        return landmark if found is None else found

    def _search(self, start: int, end: int) -> int | None:
        """The first whole record between two offsets that looks like one of those that matter."""
        while start < end:
            block = self._read(start, min(end, start + _BLOCK_BYTES) + _AHEAD_BYTES)
            for found in _CANDIDATES.finditer(block):
                offset = start + found.start()
                if offset < end and self._is_whole(offset):
                    return offset
            start += _BLOCK_BYTES
        return None

    def _is_whole(self, start: int) -> bool:
        """Whether a record that was found by its looks agrees with itself and is not torn."""
        opcode, end = self._record(start)
        if end is None or (opcode == Opcode.CHUNK and end != self._chunk_end(start)):
            return False
        return self._begins(end)

    def _read(self, start: int, end: int) -> bytes:
        if not 0 <= start < min(end, self._size):
            return b""
        self._file.seek(start)
        return self._file.read(min(end, self._size) - start)
