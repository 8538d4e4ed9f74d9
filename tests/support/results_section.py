"""Figures that a command writes into a document, between two marks that it finds or puts at the end."""

from __future__ import annotations

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
