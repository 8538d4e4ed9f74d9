"""Registries: named choices of the program, open to extensions.

A registry maps names to entries of one kind (policies, shape models, fingertip kinds ...). The program fills it with
its own, and an extension (:mod:`drivers.core.extensions`) adds to it with the same call, so that nothing distinguishes
the two. Each entry remembers the file that registered it, for messages.
"""

from __future__ import annotations

import re
import sys
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, TypeVar

from drivers.core.errors import ConfigurationError

Item = TypeVar("Item")

_NAME = re.compile("[a-z0-9][a-z0-9_-]*")


@dataclass(frozen=True)
class _Entry(Generic[Item]):
    item: Item
    file: str


class Registry(Generic[Item]):
    """Entries of one kind by name, in the order of their registration.

    Args:
        kind: what an entry is, in one or two words, for messages: "policy", "shape model".
        plural: of that word, unless an s will do.
    """

    _all: ClassVar[list[Registry[Any]]] = []

    def __init__(self, kind: str, plural: str = "") -> None:
        self.kind, self.plural = kind, plural or f"{kind}s"
        self._entries: dict[str, _Entry[Item]] = {}
        self._all.append(self)

    def register(self, name: str, item: Item) -> None:
        """Add an entry.

        Args:
            name: its name in rig files and on the command line.
            item: as described in ``docs/extending.md``.

        Raises:
            ConfigurationError: the name is not valid on the command line and in file names, or it is in use; then both
                files are named.
        """
        file = sys._getframe(1).f_code.co_filename
        if not _NAME.fullmatch(name):
            what, hint = f"registers a {self.kind} as {name!r}", "Use lower-case letters, digits, _ and -"
            raise ConfigurationError(what, where=file, hint=hint)
        if name in self._entries:
            what = f"registers the {self.kind} {name!r}, a name already used by {self.file(name)}"
            raise ConfigurationError(what, where=file, hint="Choose another name")
        self._entries[name] = _Entry(item, file)

    def __getitem__(self, name: str) -> Item:
        """The entry of this name. Raises ConfigurationError, which lists the existing names."""
        if name not in self._entries:
            raise ConfigurationError(self.unknown(name), where=self.kind, hint=f"{self.listed()}{_EXTENSIONS}")
        return self._entries[name].item

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self._entries

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def file(self, name: str) -> str:
        """The file that registered an entry; the empty string for an unknown name."""
        entry = self._entries.get(name)
        return "" if entry is None else entry.file

    def explain(self, name: str, error: Exception) -> str:
        """An error that an entry raised, in one line, with the line of its file where that is known."""
        return explain(error, self.file(name))

    def known(self, name: str) -> str:
        """The checked name; for pydantic fields. Raises ValueError, which lists the existing names."""
        if name not in self._entries:
            raise ValueError(f"{self.unknown(name)}. {self.listed()}")
        return name

    def unknown(self, name: str) -> str:
        """The message that there is no entry of this name."""
        return f"there is no {self.kind} {name!r}"

    def listed(self) -> str:
        """The names as text."""
        return f"{self.plural[:1].upper()}{self.plural[1:]} are {', '.join(self._entries)}"

    @classmethod
    def withdraw(cls, file: str) -> None:
        """Remove a file's entries from every registry."""
        for registry in cls._all:
            registry._entries = {name: entry for name, entry in registry._entries.items() if entry.file != file}


def explain(error: BaseException, file: str) -> str:
    """An unexpected error in one line: its message, and the line of ``file`` that raised it, if any."""
    words = " ".join(str(error).split())
    told = f"{type(error).__name__}: {words}" if words else type(error).__name__
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    return f"{told} (line {lines[-1]})" if lines else told


_EXTENSIONS = "; others come from files named with --extension"
