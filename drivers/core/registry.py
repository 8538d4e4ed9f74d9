"""Registries: named choices of the program, open to extensions.

A registry maps names to entries of one kind (policies, shape models, fingertip kinds ...). The program fills it with
its own, and an extension (:mod:`drivers.core.extensions`) adds to it with the same call, so that nothing distinguishes
the two. Each entry remembers the file that registered it, for messages. Names that are in neither are looked for among
the plug-ins of installed packages (:mod:`drivers.core.installed.plugins`), which are imported when they are used.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from drivers.core.errors import ConfigurationError
from drivers.core.installed.entries import NAME, explain

if TYPE_CHECKING:
    from drivers.core.installed.plugins import Plugin

Item = TypeVar("Item")


@dataclass(frozen=True)
class _Entry(Generic[Item]):
    item: Item
    file: str


class Registry(Generic[Item]):
    """Entries of one kind by name, in the order of their registration.

    Args:
        kind: what an entry is, in one or two words, for messages: "policy", "shape model".
        plural: of that word, unless an s will do.
        group: of the entry points by which packages offer such entries; "" where they cannot.
        form: what an entry must be an instance of; None: something that can be called.
    """

    _all: ClassVar[list[Registry[Any]]] = []

    def __init__(self, kind: str, plural: str = "", group: str = "", form: Any = None) -> None:
        self.kind, self.plural, self.group, self._form = kind, plural or f"{kind}s", group, form
        self._entries: dict[str, _Entry[Item]] = {}
        self._loaded: dict[str, _Entry[Item]] = {}
        """Plug-ins that were used."""

        self._all.append(self)

    def register(self, name: str, item: Item) -> None:
        """Add an entry.

        Args:
            name: its name in rig files and on the command line.
            item: as described in ``docs/extending.md``.

        Raises:
            ConfigurationError: the name is not valid on the command line and in file names, or it is in use; then both
                files are named. Or the item is no entry of this kind, such as a class in place of an instance.
        """
        file = sys._getframe(1).f_code.co_filename
        if not NAME.fullmatch(name):
            what, hint = f"registers a {self.kind} as {name!r}", "Use lower-case letters, digits, _ and -"
            raise ConfigurationError(what, where=file, hint=hint)
        if name in self._entries:
            what = f"registers the {self.kind} {name!r}, a name already used by {self.file(name)}"
            raise ConfigurationError(what, where=file, hint="Choose another name")
        if not self._fits(item):
            what = f"registers as the {self.kind} {name!r} what is none: {type(item).__name__} {item!r:.60}"
            raise ConfigurationError(what, where=file, hint="docs/extending.md says what it must be")
        self._entries[name] = _Entry(item, file)

    def __getitem__(self, name: str) -> Item:
        """The entry of this name.

        Raises:
            ConfigurationError: there is none, and the existing names are listed; or its plug-in cannot be loaded.
        """
        if (entry := self._entries.get(name) or self._loaded.get(name)) is not None:
            return entry.item
        if (plugin := self.plugin(name)) is None:
            raise ConfigurationError(self.unknown(name), where=self.kind, hint=f"{self.listed()}{_EXTENSIONS}")
        self._loaded[name] = entry = _Entry(self._checked(plugin, plugin.load()), plugin.file)
        return entry.item

    def _checked(self, plugin: Plugin, item: Any) -> Any:
        """What a plug-in gave. Raises ConfigurationError where it is not an entry of this kind."""
        if self._fits(item):
            return item
        what = (
            f"the plug-in {plugin.name!r} of {plugin.origin} is no {self.kind}, but {type(item).__name__} {item!r:.60}"
        )
        raise ConfigurationError(what, where=plugin.file, hint="docs/plugins.md says what it must be")

    def _fits(self, item: Any) -> bool:
        return callable(item) if self._form is None else isinstance(item, self._form)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and (name in self._entries or self.plugin(name) is not None)

    def __iter__(self) -> Iterator[str]:
        yield from self._entries
        yield from (name for name, one in self.plugins().items() if name not in self._entries and not one.obstacle)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def registered(self) -> tuple[str, ...]:
        """The names registered by the program and its extensions, without plug-ins: nothing is looked for."""
        return tuple(self._entries)

    def items(self) -> Iterator[tuple[str, Item]]:
        """All names with their entries, but for plug-ins that cannot be loaded: nobody asked for these."""
        for name in self:
            try:
                yield name, self[name]
            except ConfigurationError:
                continue

    def plugins(self) -> dict[str, Plugin]:
        """What installed packages offer, by name; also where the name is taken, and this is not used."""
        if not self.group:
            return {}
        from drivers.core.installed.plugins import offered  # late: the command line starts without it

        return offered(self.group)

    def plugin(self, name: str) -> Plugin | None:
        """The plug-in behind a name; None where it is an entry of the program, of an extension, or of nobody."""
        return None if name in self._entries else self.plugins().get(name)

    def file(self, name: str) -> str:
        """The file that registered an entry, or of the plug-in; the empty string for an unknown name."""
        if (entry := self._entries.get(name) or self._loaded.get(name)) is not None:
            return entry.file
        plugin = self.plugin(name)
        return "" if plugin is None else plugin.file

    def explain(self, name: str, error: BaseException) -> str:
        """An error that an entry raised, in one line, with the line of its file where that is known."""
        return explain(error, self.file(name))

    def known(self, name: str) -> str:
        """The checked name; for pydantic fields. Raises ValueError, which lists the existing names."""
        if name not in self:
            raise ValueError(f"{self.unknown(name)}. {self.listed()}")
        if name not in self._entries:
            try:
                self[name]
            except ConfigurationError as error:
                raise ValueError(str(error)) from error
        return name

    def unknown(self, name: str) -> str:
        """The message that there is no entry of this name."""
        return f"there is no {self.kind} {name!r}"

    def listed(self) -> str:
        """The names as text."""
        return f"{self.plural[:1].upper()}{self.plural[1:]} are {', '.join(self)}"

    @classmethod
    def plugin_problems(cls) -> dict[Plugin, str]:
        """Why installed plug-ins of the registries that are in use cannot be, without loading them."""
        found = {}
        for registry in cls._all:
            for name, plugin in registry.plugins().items():
                if name in registry._entries:
                    found[plugin] = f"has a name that is already used by {registry.file(name)}: choose another"
                elif plugin.obstacle:
                    found[plugin] = plugin.obstacle
        return found

    @classmethod
    def plugin_files(cls) -> set[str]:
        """The files of the plug-ins in use."""
        return {entry.file for registry in cls._all for entry in registry._loaded.values()}

    @classmethod
    def withdraw(cls, file: str) -> None:
        """Remove a file's entries from every registry."""
        for registry in cls._all:
            registry._entries = {name: entry for name, entry in registry._entries.items() if entry.file != file}


_EXTENSIONS = "; others come from files named with --extension"
