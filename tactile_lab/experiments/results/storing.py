"""Adds a new part to a stored result: its rows replace those with the same settings; the others stay, as older ones."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from drivers.core.errors import SessionError
from tactile_lab.experiments.results.stored_result import Part, StoredResult

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


def combine(new: Part, before: tuple[Part, ...]) -> tuple[Part, ...]:
    """The new part, and the rows of earlier parts that it does not have.

    Parts made by the same version are merged, with all of their commands.
    """
    if before and before[0].made_by.sources == new.made_by.sources:
        commands = dict.fromkeys((*before[0].commands, *new.commands))
        new = replace(new, commands=tuple(commands))
    left = [_without(part, new) for part in before]
    return (new, *(part for part in left if part.tables))


def _without(part: Part, newer: Part) -> Part:
    tables = part.tables
    for other in newer.tables:
        tables = tuple(table.without(other) for table in tables)
    return replace(part, tables=tuple(table for table in tables if table.rows))
