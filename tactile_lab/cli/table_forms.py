"""Tables that cut nothing off: rows and columns if they fit, otherwise one block of lines per row."""

from __future__ import annotations

from collections.abc import Sequence

from rich import box
from rich.cells import cell_len
from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from tactile_lab.cli.visible import visible

_LAST_COLUMN = 24
"""Minimum width of the last column when it is wrapped."""
_GAP, _EDGES = 3, 2
"""Spaces between two columns of a table, and in total at both sides."""
_INDENT = 2

Rows = Sequence[Sequence[str]]


def table_form(
    console: Console, title: str, columns: Sequence[str], rows: Rows, right: Sequence[int]
) -> RenderableType:
    """A table as a console shows it.

    A terminal that is too narrow gets blocks. In a file or a pipe a row is one line, as wide as needed.

    Args:
        right: indices of the columns that hold numbers.
    """
    title, shown = visible(title), [[visible(cell) for cell in row] for row in rows]
    *widths, last = [max(map(_width, column)) for column in zip(columns, *shown, strict=True)]
    others = sum(widths) + _GAP * len(widths) + _EDGES
    if not console.is_terminal:
        return _table(title, columns, shown, right, max(others + last, _width(title)))
    if others + min(last, _LAST_COLUMN) > console.width:
        return _blocks(title, columns, shown)
    return _table(title, columns, shown, right, None)


def facts_form(console: Console, facts: Rows) -> Table:
    """Names with values as a console shows them: long values are wrapped on a terminal, but not in a file or a pipe."""
    grid = facts_grid(facts)
    if not console.is_terminal:
        shown = ((visible(cell) for cell in fact) for fact in facts)
        grid.width = sum(max(map(_width, column), default=0) for column in zip(*shown, strict=True)) + _INDENT
    return grid


def facts_grid(facts: Rows) -> Table:
    """Names with values, without rules; long values are wrapped, even within a word such as a path."""
    grid = Table.grid(padding=(0, _INDENT))
    grid.add_column(style="dim", no_wrap=True)
    grid.add_column(overflow="fold")
    for name, value in facts:
        grid.add_row(Text(visible(name)), Text(visible(value)))
    return grid


def _width(cell: str) -> int:
    return max(map(cell_len, cell.splitlines()), default=0)


def _table(title: str, columns: Sequence[str], rows: Rows, right: Sequence[int], width: int | None) -> Table:
    """Rows and columns; as wide as the console allows if width is None."""
    grid = Table(
        box=box.SIMPLE_HEAD, title=Text(title), title_justify="left", title_style="bold", pad_edge=False, width=width
    )
    for index, column in enumerate(columns):
        last = index == len(columns) - 1
        grid.add_column(Text(column), justify="right" if index in right else "left", no_wrap=not last, overflow="fold")
    for row in rows:
        grid.add_row(*map(Text, row))
    return grid


def _blocks(title: str, columns: Sequence[str], rows: Rows) -> Group:
    """A heading for each row (its first cell), followed by its other non-empty cells with their column names."""
    blocks: list[RenderableType] = [Text(title, style="bold")]
    for row in rows:
        facts = [(name and f"{name}:", cell) for name, cell in zip(columns[1:], row[1:], strict=True) if cell]
        blocks += [Text(""), Text(row[0], overflow="fold"), Padding(facts_grid(facts), (0, 0, 0, _INDENT))]
    return Group(*blocks, Text(""))
