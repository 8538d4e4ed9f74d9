"""Reads the records of an MCAP file one by one, complete or truncated."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

_FRAME = struct.Struct("<BQ")


def ends_well(path: Path) -> bool:
    """Whether a file ends like a finished MCAP file; nothing else is checked."""
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(max(0, size - len(MCAP0_MAGIC)))
        return file.read() == MCAP0_MAGIC


class Frames:
    """Iterates over the records of an MCAP file, truncated or not, as opcode and content."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._size = file.seek(0, 2)
        file.seek(0)
        magic = file.read(len(MCAP0_MAGIC))
        self.is_mcap = MCAP0_MAGIC.startswith(magic)
        self.complete = False
        """Whether the closing magic was reached."""
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
