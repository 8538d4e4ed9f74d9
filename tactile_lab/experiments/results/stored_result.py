"""The stored outcome of an experiment: tables and a plot, the command, the seeds, and the version that made them.

Each result is one JSON file, with a row of a table on one line, so that differences are readable. A result has several
parts if only some of its rows were made again: rows made by an earlier version are kept and marked as such.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

from drivers.core.atomic_files import write_whole
from drivers.core.errors import ConfigurationError, SessionDataError
from drivers.core.reading.bounded_files import LARGEST_JSON_bytes, read_bounded
from drivers.core.reading.json_text import parse_json
from tactile_lab.experiments.plot_data import Plot
from tactile_lab.experiments.results.page_ages import ASK

FORMAT = "tactile-result/1"
TOGETHER = "All values of "
"""Begins the title of a table whose rows stand for several rows of the last table each."""


@dataclass(frozen=True)
class Table:
    """A table of texts.

    Attributes:
        title: text above it, "" for none.
        head: titles of the columns.
        rows: one text per column.
        keys: number of first columns that identify a row.
    """

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    keys: int = 1

    def key(self, row: Sequence[str]) -> tuple[str, ...]:
        """The texts that identify a row."""
        return tuple(row[: self.keys])

    @property
    def is_pooled(self) -> bool:
        """Whether each row stands for several rows of the part's last table."""
        return self.title.startswith(TOGETHER)

    def without(self, other: Table) -> Table:
        """The rows that the other table does not have; all of them if it is about something else."""
        known = {other.key(row) for row in other.rows} if self._is_alike(other) else set()
        return replace(self, rows=tuple(row for row in self.rows if self.key(row) not in known))

    def _is_alike(self, other: Table) -> bool:
        """Whether the same rows are identified in the same way; what is told of them may differ."""
        keys = self.head[: self.keys], other.head[: other.keys]
        return self.head == other.head or (self.title == other.title and keys[0] == keys[1])

    def as_json(self) -> dict[str, Any]:
        """Plain data."""
        rows = [list(row) for row in self.rows]
        return {"title": self.title, "keys": self.keys, "head": list(self.head), "rows": rows}

    @classmethod
    def from_json(cls, found: Mapping[str, Any]) -> Self:
        """Raises KeyError, TypeError or ValueError for what :meth:`as_json` did not write."""
        head, rows = tuple(found["head"]), tuple(tuple(row) for row in found["rows"])
        if any(len(row) != len(head) for row in rows):
            raise ValueError(f"a row of the table {found['title']!r} is not as long as its head")
        return cls(found["title"], head, rows, int(found["keys"]))


@dataclass(frozen=True)
class MadeBy:
    """The origin of a result.

    Attributes:
        program: version of the package.
        sources: hash of the sources that results depend on; None if it was not kept.
        commit: commit of the repository, if the hash was not kept; None otherwise.
        date: day, ISO 8601.
        machine: description of the machine.
    """

    program: str
    sources: str | None
    commit: str | None
    date: str
    machine: str

    @property
    def version(self) -> str:
        """What names the code that made it: the hash of its sources, or a commit."""
        return self.sources or self.commit or "unknown"

    def is_of(self, sources: str) -> bool:
        """Whether these sources made it."""
        return self.sources == sources

    def in_words(self) -> str:
        """The version as a sentence."""
        by = f"commit {self.commit}" if self.sources is None else f"sources {self.sources}, version {self.program}"
        return f"Made on {self.date} by {by}, on {self.machine}. {ASK}"


@dataclass(frozen=True)
class Part:
    """The part of a result that one version of the program made.

    Attributes:
        made_by: that version.
        commands: the commands that made it.
        about: seeds and numbers of runs as text, "" if the tables show them.
        tables: in the order of the page.
        plot: the plot, None if there is none.
    """

    made_by: MadeBy
    commands: tuple[str, ...]
    about: str
    tables: tuple[Table, ...]
    plot: Plot | None = None

    def as_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "made_by": vars(self.made_by),
            "commands": list(self.commands),
            "about": self.about,
            "tables": [table.as_json() for table in self.tables],
            "plot": None if self.plot is None else self.plot.as_json(),
        }

    @classmethod
    def from_json(cls, found: Mapping[str, Any]) -> Self:
        """Raises KeyError, TypeError or ValueError for what :meth:`as_json` did not write."""
        plot = None if found["plot"] is None else Plot.from_json(found["plot"])
        tables = tuple(map(Table.from_json, found["tables"]))
        return cls(MadeBy(**found["made_by"]), tuple(found["commands"]), found["about"], tables, plot)


@dataclass(frozen=True)
class StoredResult:
    """A result stored in the repository.

    Attributes:
        name: name of its file and of its page.
        sentence: what it shows.
        parts: the parts made by each version, the newest first.
    """

    name: str
    sentence: str
    parts: tuple[Part, ...]

    @classmethod
    def read(cls, file: Path) -> Self:
        """Read a file.

        Raises:
            SessionDataError: it cannot be read, or is not a stored result.
        """
        try:
            found = parse_json(read_bounded(file, LARGEST_JSON_bytes))
            if found["format"] != FORMAT:
                raise ValueError(f"format {found['format']!r}")
            return cls(found["name"], found["sentence"], tuple(map(Part.from_json, found["parts"])))
        except (OSError, ValueError, KeyError, TypeError, ConfigurationError) as error:
            hint = "Restore it from the repository, or store the result again"
            raise SessionDataError(f"is not a stored result ({error!r})", where=str(file), hint=hint) from error

    def write(self, folder: Path) -> Path:
        """Write the file ``NAME.json`` into a folder and return its path. Raises WriteError."""
        parts = [part.as_json() for part in self.parts]
        content = {"format": FORMAT, "name": self.name, "sentence": self.sentence, "parts": parts}
        file = folder / f"{self.name}.json"
        write_whole(file, dump_json(content) + "\n")
        return file


def dump_json(content: Any, indent: str = "") -> str:
    """JSON text in which innermost lists and objects are on one line."""
    inside = list(content.values() if isinstance(content, dict) else content if isinstance(content, list) else ())
    if not any(isinstance(part, dict | list) for part in inside):
        return json.dumps(content, ensure_ascii=False, allow_nan=False)
    parts = [dump_json(part, indent + " ") for part in inside]
    if isinstance(content, dict):
        parts = [f"{json.dumps(name)}: {part}" for name, part in zip(content, parts, strict=True)]
    begin, end = "{}" if isinstance(content, dict) else "[]"
    lines = ",\n".join(f"{indent} {part}" for part in parts)
    return f"{begin}\n{lines}\n{indent}{end}"
