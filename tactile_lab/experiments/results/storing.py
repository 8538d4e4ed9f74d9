"""A new part into a stored result: its rows replace those of the same settings, the others stay as older ones."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from drivers.core.errors import SessionError
from tactile_lab.experiments.results.stored_result import Part, StoredResult

RESULTS, DATA, NOTES, PICTURES = "results", "data", "notes", "pictures"
"""Folders: pages under the documents, stored results and notes under the pages, pictures under the documents."""


def store(docs: Path, name: str, sentence: str, part: Part, *, forget: bool = False) -> Path:
    """Put a part into the stored result ``name`` of a folder of documents, and give its file.

    Args:
        docs: folder of the documents, with the folder of the results in it.
        name: of the result.
        sentence: what it shows.
        part: what this version of the program made.
        forget: leave out what earlier versions made.

    Raises:
        SessionError: there is no such folder, or the file there is no stored result.
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
    """The new part, and of those before what it does not have.

    Commands of the same version are collected: its runs go on in one file.
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
