"""Plug-ins: entries of registries that installed packages offer as entry points.

A package names them in its ``pyproject.toml``, one table for each kind, and the program finds them by itself::

    [project.entry-points."tactile_lab.policies"]
    quickest = "my_laboratory.quickest:Quickest"

A plug-in is imported only when its name is used. One that cannot be used is refused by name and file, and
changes nothing for the others. docs/plugins.md says what each kind is.
"""

from __future__ import annotations

import re
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.metadata import EntryPoint, PackageNotFoundError, entry_points, version
from importlib.util import find_spec
from typing import Any

from drivers.core.errors import ConfigurationError
from drivers.core.installed.entries import NAME, explain

PROGRAM = "tactile-lab"
GROUPS = "tactile_lab."
"""What the names of all groups of entry points begin with; the rest is the kind's."""


@dataclass(frozen=True)
class Plugin:
    """An entry that an installed package offers.

    Attributes:
        group: kind of entry, the entry point's group without its beginning: "policies".
        name: of the entry, in rig files and on the command line.
        package, version: of the distribution that offers it.
        target: module and object, as in the package's metadata.
        obstacle: why it cannot be used, as a clause; empty if there is none.
    """

    group: str
    name: str
    package: str
    version: str
    target: str
    obstacle: str
    _point: EntryPoint = field(repr=False, compare=False)

    @property
    def origin(self) -> str:
        """Package and version, for messages."""
        return f"{self.package} {self.version}"

    @property
    def file(self) -> str:
        """The file of its module; the package with its version if that is unknown before running it."""
        for module in (self._point.module, self._point.module.partition(".")[0]):
            try:
                spec = find_spec(module)
            except Exception:  # a package above the module fails: its own file is told instead
                continue
            if spec is not None and spec.origin:
                return spec.origin
        return self.origin

    def load(self) -> Any:
        """Import it.

        Raises:
            ConfigurationError: it cannot be used, or its module raises; names its file and package.
        """
        hint = f"Correct {self.package}, or uninstall it"
        if self.obstacle:
            raise ConfigurationError(f"the plug-in {self.name!r} of {self.origin} {self.obstacle}", where=self.file)
        try:
            return self._point.load()
        except (Exception, SystemExit) as error:  # a module may end the program instead of raising
            told = explain(error, self.file)
            what = f"the plug-in {self.name!r} of {self.origin} could not be loaded: {told}"
            raise ConfigurationError(what, where=self.file, hint=hint) from error


@cache
def installed_plugins() -> tuple[Plugin, ...]:
    """All plug-ins of the running Python, by group, name and package; looked for once in a process."""
    try:
        found = [_plugin(point) for point in _points()]
    except Exception as error:  # another package's damaged metadata
        warnings.warn(f"plug-ins cannot be listed: {error}", stacklevel=2)
        return ()
    counts = Counter((each.group, each.name) for each in found)
    told = [_refuse_twins(each, found) if counts[each.group, each.name] > 1 else each for each in found]
    return tuple(sorted(told, key=lambda each: (each.group, each.name, each.package)))


def offered(group: str) -> dict[str, Plugin]:
    """The plug-ins of a group by name; of several with one name the first, which then has an obstacle."""
    return {each.name: each for each in reversed(installed_plugins()) if each.group == group}


def _points() -> Iterator[EntryPoint]:
    found = entry_points()
    for group in sorted(found.groups):
        if group.startswith(GROUPS):
            yield from found.select(group=group)


def _plugin(point: EntryPoint) -> Plugin:
    package = point.dist.name if point.dist else "an unknown package"
    number = point.dist.version if point.dist else "?"
    requirements = (point.dist.requires if point.dist else None) or []
    group = point.group.removeprefix(GROUPS)
    return Plugin(group, point.name, package, number, point.value, _obstacle(point.name, requirements), point)


def _obstacle(name: str, requirements: list[str]) -> str:
    if not NAME.fullmatch(name):
        return "has a name that is none: use lower-case letters, digits, _ and -"
    try:
        ours = version(PROGRAM)
    except PackageNotFoundError:  # run from its sources
        return ""
    wanted = next((text for text in map(_required_versions, requirements) if text and not _allows(text, ours)), "")
    return f"is made for {PROGRAM} {wanted}, and this is {ours}: install the version that fits" if wanted else ""


def _required_versions(requirement: str) -> str:
    """The versions of this program that a requirement asks for, "" if it asks for something else or for any."""
    from packaging.requirements import Requirement

    asked = Requirement(requirement)
    concerns_us = re.sub("[-_.]+", "-", asked.name).lower() == PROGRAM
    holds = asked.marker is None or asked.marker.evaluate({"extra": ""})
    return str(asked.specifier) if concerns_us and holds else ""


def _allows(specifier: str, number: str) -> bool:
    from packaging.specifiers import SpecifierSet

    return SpecifierSet(specifier).contains(number, prereleases=True)


def _refuse_twins(plugin: Plugin, among: list[Plugin]) -> Plugin:
    others = [
        each.origin for each in among if (each.group, each.name) == (plugin.group, plugin.name) and each != plugin
    ]
    obstacle = f"has a name that {' and '.join(others)} uses too: uninstall one of them"
    return replace(plugin, obstacle=obstacle)
