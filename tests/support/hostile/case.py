"""One hostile file: what it is, and the command that reads it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

FILE = "FILE"
"""Stands for the file's path in the words of a command."""


@dataclass(frozen=True)
class Case:
    """A file that nobody should have to read.

    Attributes:
        kind: of file, as the program takes it.
        name: what is wrong with it.
        words: the command, with :data:`FILE` in it.
        suffix: of the file's name.
        make: its bytes, or what makes it at a path of which only the folder is there.
    """

    kind: str
    name: str
    words: tuple[str, ...]
    suffix: str
    make: bytes | Callable[[Path], None]

    def write(self, folder: Path) -> Path:
        """Make the file in a folder of its own."""
        path = folder / f"hostile{self.suffix}"
        if isinstance(self.make, bytes):
            path.write_bytes(self.make)
        else:
            self.make(path)
        return path

    def command(self, path: Path) -> list[str]:
        """The words of the command line."""
        return [word.replace(FILE, str(path)) for word in self.words]


@dataclass(frozen=True)
class Kind:
    """A kind of file, and the command that reads it."""

    name: str
    words: tuple[str, ...]
    suffix: str

    def cases(self, contents: dict[str, bytes | str | Callable[[Path], None]]) -> Iterator[Case]:
        """Cases by what is wrong with the file."""
        for name, content in contents.items():
            made = content.encode() if isinstance(content, str) else content
            yield Case(self.name, name, self.words, self.suffix, made)
