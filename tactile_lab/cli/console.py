"""Where words go: people's text to standard error, one JSON document to standard output."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

people = Console(stderr=True, highlight=False)
"""For people: standard error, colours only on a terminal and without NO_COLOR."""


def say(text: str, style: str = "") -> None:
    """One line for people, shown as it is (no markup)."""
    people.print(Text(text, style=style), soft_wrap=True)


def complain(text: str) -> None:
    """One error line for people."""
    people.print(Text.assemble(("error: ", "bold red"), text), soft_wrap=True)


def warn(text: str) -> None:
    """One warning line for people."""
    people.print(Text.assemble(("warning: ", "bold yellow"), text), soft_wrap=True)


def emit_json(document: Any) -> None:
    """The one machine-readable document of a command. NaN is not JSON and is refused."""
    json.dump(document, sys.stdout, indent=2, allow_nan=False)
    sys.stdout.write("\n")


def table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], *, right: Sequence[int] = ()) -> Table:
    """A plain table; ``right`` lists the columns that hold numbers."""
    grid = Table(title=Text(title), title_justify="left", title_style="bold", header_style="bold")
    for index, column in enumerate(columns):
        grid.add_column(column, justify="right" if index in right else "left")
    for row in rows:
        grid.add_row(*map(Text, row))
    return grid
