"""Where words go: people's text to standard error, one JSON document to standard output."""

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
"""For people: standard error, colours only on a terminal and without NO_COLOR."""


class Onlooker(Protocol):
    """Somewhere else that people are told the same, such as a wizard's page."""

    def line(self, text: str, style: str = "") -> None: ...
    def table(
        self, title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], right: Sequence[int]
    ) -> None: ...


_onlookers: list[Onlooker] = []


@contextmanager
def tell_also(onlooker: Onlooker) -> Iterator[None]:
    """Within the block, whatever people are told here is told there too."""
    _onlookers.append(onlooker)
    try:
        yield
    finally:
        _onlookers.remove(onlooker)


def say(text: str, style: str = "") -> None:
    """One line for people, shown as it is (no markup, never broken)."""
    _tell(Text(text, style=style), style)


def count(number: int, noun: str) -> str:
    """A number of things: "1 grasp", "3 grasps"."""
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
    """The one machine-readable document of a command. NaN is not JSON and is refused."""
    text = json.dumps(document, indent=2, allow_nan=False)
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def show_table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], *, right: Sequence[int] = ()) -> None:
    """A table with a rule below its head; ``right`` lists the columns that hold numbers.

    Cells are shown as they are. The last column takes what room is left and wraps; on a terminal that is too narrow
    for the others each row is a block of lines.
    """
    shown = list(rows)
    people.print(table_form(people, title, columns, shown, right), crop=False)
    for onlooker in _onlookers:
        onlooker.table(title, columns, shown, right)


def show_facts(title: str, facts: Iterable[tuple[str, str]]) -> None:
    """Names with values; facts without a value are left out."""
    shown = [(name, value) for name, value in facts if value]
    people.print(Text(title, style="bold"), soft_wrap=True)
    people.print(facts_form(people, shown), crop=False)
    for onlooker in _onlookers:
        onlooker.table(title, ("", ""), shown, ())
