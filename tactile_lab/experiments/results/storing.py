"""Adds a new part to a stored result: its rows replace those with the same settings; the others stay, as older ones.

A row of all shapes together is replaced only by one of at least the same shapes. Where only some of them were run
again, the older row stays: the new one would show other runs under its name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from drivers.core.errors import SessionError
from tactile_lab.experiments.results.stored_result import Part, StoredResult, Table

Row = tuple[str, ...]

RESULTS, DATA, NOTES, PICTURES = "results", "data", "notes", "pictures"
"""Folders: pages in the documents, stored results and notes in the pages' folder, pictures in the documents."""


def store(docs: Path, name: str, sentence: str, part: Part, *, forget: bool = False) -> Path:
    """Add a part to the stored result ``name`` in a folder of documents; returns its file.

    Args:
        docs: folder of the documents, which contains the folder of results.
        name: name of the result.
        sentence: what it shows.
        part: the part made by this version of the program.
        forget: whether to drop what earlier versions made.

    Raises:
        SessionError: there is no such folder, or the file in it is not a stored result.
        WriteError: the file cannot be written.
    """
    folder = docs / RESULTS / DATA
    if not folder.is_dir():
        hint = "Run the command in the repository, or give its documentation folder with --docs"
        raise SessionError("contains no stored results", where=str(docs), hint=hint)
    file = folder / f"{name}.json"
    before = StoredResult.read(file).parts if file.is_file() and not forget else ()
    return StoredResult(name, sentence, combine(part, before)).write(folder)


def partial_rows(docs: Path, name: str, part: Part) -> list[str]:
    """Rows of several settings together that :func:`store` would leave out, as they are of fewer than those stored.

    Raises:
        SessionError: the file is not a stored result.
    """
    file = docs / RESULTS / DATA / f"{name}.json"
    before = StoredResult.read(file).parts if file.is_file() else ()
    return [
        ", ".join(table.key(row))
        for table in part.tables
        for row in table.rows
        if _is_partial(table, row, part, before)
    ]


def combine(new: Part, before: tuple[Part, ...]) -> tuple[Part, ...]:
    """The new part, and the rows of earlier parts that it does not have.

    Parts made by the same version are merged, with all of their commands.
    """
    new = _without_partial_rows(new, before)
    if before and before[0].made_by.sources == new.made_by.sources:
        commands = dict.fromkeys((*before[0].commands, *new.commands))
        new = replace(new, commands=tuple(commands))
    left = [_without(part, new) for part in before]
    return (new, *(part for part in left if part.tables))


def _without_partial_rows(new: Part, before: tuple[Part, ...]) -> Part:
    whole = [
        replace(table, rows=tuple(row for row in table.rows if not _is_partial(table, row, new, before)))
        for table in new.tables
    ]
    return replace(new, tables=tuple(table for table in whole if table.rows))


def _is_partial(table: Table, row: Row, new: Part, before: tuple[Part, ...]) -> bool:
    """Whether a row of several together is of fewer than the stored row that it would replace."""
    if not table.is_pooled:
        return False
    for place, part in enumerate(before):
        if any(table.key(row) in map(other.key, other.rows) for other in part.tables if other.title == table.title):
            return not _behind(table, row, before[: place + 1]) <= _behind(table, row, (new,))
    return False


def _behind(table: Table, row: Row, parts: Sequence[Part]) -> set[Row]:
    """Keys of the single rows of parts that a row of several together stands for."""
    asked = dict(zip(table.head[: table.keys], row, strict=False))
    single = [table for part in parts for table in part.tables if not table.is_pooled]
    return {
        one.key(each)
        for one in single
        for each in one.rows
        if all(asked.get(title, text) == text for title, text in zip(one.head[: one.keys], each, strict=False))
    }


def _without(part: Part, newer: Part) -> Part:
    tables = part.tables
    for other in newer.tables:
        tables = tuple(table.without(other) for table in tables)
    return replace(part, tables=tuple(table for table in tables if table.rows))
