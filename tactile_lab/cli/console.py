"""Output: text for people to standard error, one JSON document to standard output."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Protocol

from rich.console import Console
from rich.text import Text

from tactile_lab.cli.table_forms import facts_form, table_form

people = Console(stderr=True, highlight=False)
"""Text for people: standard error, in colour only on a terminal and without NO_COLOR."""


class Onlooker(Protocol):
    """Another place that shows the same text, such as a wizard's page."""

    def line(self, text: str, style: str = "") -> None: ...
    def table(
        self, title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], right: Sequence[int]
    ) -> None: ...


_onlookers: list[Onlooker] = []


@contextmanager
def tell_also(onlooker: Onlooker) -> Iterator[None]:
    """Within the block, everything printed for people is also shown there."""
    _onlookers.append(onlooker)
    try:
        yield
    finally:
        _onlookers.remove(onlooker)


def say(text: str, style: str = "") -> None:
    """One line for people, printed literally (no markup, no wrapping)."""
    _tell(Text(text, style=style), style)


def count(number: int, noun: str) -> str:
    """A number with its noun: "1 grasp", "3 grasps"."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def complain(text: str) -> None:
    """One error line for people."""
    _tell(Text.assemble(("error: ", "bold red"), text), "bold red")


def warn(text: str) -> None:
    """One warning line for people."""
    _tell(Text.assemble(("warning: ", "bold yellow"), text), "bold yellow")


def _tell(line: Text, style: str) -> None:
    people.print(line, soft_wrap=True)
    for onlooker in _onlookers:
        onlooker.line(line.plain, style)


def emit_json(document: Any) -> None:
    """Print the command's single JSON document. NaN is not JSON and is refused."""
    text = json.dumps(document, indent=2, allow_nan=False)
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def show_table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], *, right: Sequence[int] = ()) -> None:
    """A table with a rule below its header; ``right`` lists the columns that hold numbers.

    Cells are printed literally. The last column takes the remaining width and wraps; on a terminal too narrow for the
    other columns each row becomes a block of lines.
    """
    shown = list(rows)
    people.print(table_form(people, title, columns, shown, right), crop=False)
    for onlooker in _onlookers:
        onlooker.table(title, columns, shown, right)


def show_facts(title: str, facts: Iterable[tuple[str, str]]) -> None:
    """Names with values; empty values are left out."""
    shown = [(name, value) for name, value in facts if value]
    people.print(Text(title, style="bold"), soft_wrap=True)
    people.print(facts_form(people, shown), crop=False)
    for onlooker in _onlookers:
        onlooker.table(title, ("", ""), shown, ())
