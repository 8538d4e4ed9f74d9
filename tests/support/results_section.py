"""Figures that a command writes into a document, between two marks that it finds or puts at the end."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path


def write_section(document: Path, name: str, text: str) -> None:
    """Put ``text`` between the marks of ``name``, in place of what stood there."""
    begin, end = f"<!-- {name}: written by a command, do not edit -->", f"<!-- {name}: end -->"
    content = document.read_text(encoding="utf-8")
    if begin not in content:
        content = f"{content.rstrip()}\n\n{begin}\n{end}\n"
    head, rest = content.split(begin, 1)
    _, tail = rest.split(end, 1)
    document.write_text(f"{head}{begin}\n{text.rstrip()}\n{end}{tail}", encoding="utf-8")


Key = tuple[str, ...]
"""First cells of a row."""


class GrowingTable:
    """A table that is written row by row, so that a run that is broken off or does a part leaves the rest as it was.

    Args:
        document: holds the table between the marks of ``name``; None only prints.
        head: all before the first row.
        keys: of all rows, in their order.
    """

    def __init__(self, document: Path | None, name: str, head: str, keys: Sequence[Key]) -> None:
        self._document, self._name, self._head, self._keys = document, name, head, tuple(keys)
        self._rows = {} if document is None else self._found(document.read_text(encoding="utf-8").splitlines())

    @property
    def missing(self) -> tuple[Key, ...]:
        """Rows that the document does not have."""
        return tuple(key for key in self._keys if key not in self._rows)

    def put(self, key: Key, cells: Sequence[str]) -> None:
        """A new row; shown, and written."""
        self._rows[key] = f"| {' | '.join(' '.join(cell.split()) for cell in (*key, *cells))} |"
        print(self._rows[key], flush=True)
        if self._document is not None:
            rows = (self._rows[known] for known in self._keys if known in self._rows)
            write_section(self._document, self._name, self._head + "\n".join(rows))

    def _found(self, lines: Sequence[str]) -> dict[Key, str]:
        within, found = False, {}
        for line in lines:
            within = line.startswith(f"<!-- {self._name}: written") or (within and not line.startswith("<!--"))
            cells = tuple(cell.strip() for cell in line.strip("|").split(" | "))
            found |= {key: line for key in self._keys if within and cells[: len(key)] == key}
        return found
