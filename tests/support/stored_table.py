"""A stored result with one table that a command fills row by row."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tactile_lab.experiments.reporting import made_here
from tactile_lab.experiments.results.publishing import publish, stored_results
from tactile_lab.experiments.results.stored_result import Part, Table
from tactile_lab.experiments.results.storing import store

Key = tuple[str, ...]
"""First cells of a row, which identify it."""


@dataclass(frozen=True)
class Outline:
    """Description of a table.

    Attributes:
        name: of the stored result.
        sentence: what it shows.
        commands: that make it.
        about: how it was made.
        head: titles of the columns.
        keys: number of first cells that identify a row.
    """

    name: str
    sentence: str
    commands: tuple[str, ...]
    about: str
    head: tuple[str, ...]
    keys: int = 1


class GrowingTable:
    """A table that is stored row by row, so that an interrupted or partial run leaves the other rows unchanged.

    Args:
        docs: folder of the documents; None only prints.
        outline: of the table.
        order: keys of all rows in order.
    """

    def __init__(self, docs: Path | None, outline: Outline, order: Sequence[Key]) -> None:
        self._docs, self._outline, self._order, self._made_by = docs, outline, tuple(order), made_here()
        self._rows = {} if docs is None else self._of_this_version(docs)

    @property
    def missing(self) -> tuple[Key, ...]:
        """Rows that this version of the program has not made yet."""
        return tuple(key for key in self._order if key not in self._rows)

    def put(self, key: Key, cells: Sequence[str]) -> None:
        """Add a new row: show and store it."""
        self._rows[key] = tuple(" ".join(cell.split()) for cell in (*key, *cells))
        print(" | ".join(self._rows[key]), flush=True)
        if self._docs is not None:
            rows = tuple(self._rows[known] for known in self._order if known in self._rows)
            outline = self._outline
            table = Table("", outline.head, rows, outline.keys)
            part = Part(self._made_by, outline.commands, outline.about, (table,))
            store(self._docs, outline.name, outline.sentence, part)

    def publish(self) -> None:
        """Write the pages, if there is a folder of documents."""
        if self._docs is not None:
            publish(self._docs)

    def _of_this_version(self, docs: Path) -> dict[Key, tuple[str, ...]]:
        result = stored_results(docs).get(self._outline.name)
        parts = [part for part in result.parts if part.made_by.sources == self._made_by.sources] if result else []
        tables = [table for part in parts for table in part.tables if table.head == self._outline.head]
        return {table.key(row): row for table in tables for row in table.rows}


def parser(description: str | None) -> argparse.ArgumentParser:
    """Options that all these commands have; ``docs`` is None if nothing is stored."""
    options = argparse.ArgumentParser(description=description)
    options.add_argument("--store", dest="docs", action="store_const", const=Path("docs"), help="keep it in docs/")
    return options
