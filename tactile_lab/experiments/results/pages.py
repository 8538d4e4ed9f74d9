"""The page of a stored result: its origin, its meaning, its commands, its plot and its tables."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from textwrap import fill
from typing import TypeAlias

from tactile_lab.experiments.plot_data import CURVES_KEY, RANGES_KEY, CurvePanel, Plot, RangePanel
from tactile_lab.experiments.plot_sheet import EARLIER
from tactile_lab.experiments.results.stored_result import Part, StoredResult, Table
from tactile_lab.experiments.summary import markdown

SPREADS = "Where a heading says nothing else, three figures are median / p90 / maximum."
WIDTH = 140
"""Line length of prose on the pages."""
_ABOUT = re.compile(r"<!-- about: (?P<version>.+?) -->\n+")


def page(result: StoredResult, notes: str = "", picture: str = "") -> str:
    """The page in Markdown.

    Args:
        result: the result that it shows.
        notes: written by hand in Markdown; a first line ``<!-- about: VERSION -->`` names the version that they refer
            to.
        picture: path of the plot, relative to the page; "" if there is none.
    """
    first, *earlier = result.parts
    begin = [f"# {result.name}", fill(result.sentence, WIDTH), first.made_by.in_words()]
    begin += [_notes(notes, first)] if notes else []
    begin += [f"![{result.sentence}]({picture})"] if picture else []
    parts = [_part(first), *(f"## Made earlier\n\n{part.made_by.in_words()}\n\n{_part(part)}" for part in earlier)]
    return "\n\n".join([*begin, *parts]) + "\n"


def _part(part: Part) -> str:
    commands = "\n".join(part.commands)
    about = " ".join(text for text in (part.about, SPREADS if _has_spreads(part) else "") if text)
    pieces = [f"```\n{commands}\n```" if commands else "", fill(about, WIDTH), *map(_table, part.tables)]
    return "\n\n".join(piece for piece in pieces if piece)


def _has_spreads(part: Part) -> bool:
    return any(text.count(" / ") == 2 for table in part.tables for row in table.rows for text in row)


def _table(table: Table) -> str:
    title = f"{table.title}:\n\n" if table.title else ""
    return title + markdown([table.head, *table.rows]).rstrip("\n")


def _notes(notes: str, newest: Part) -> str:
    """The hand-written notes, with a remark if they refer to another version than the figures."""
    found, text = _ABOUT.match(notes), _ABOUT.sub("", notes, count=1).strip()
    if found is None or found["version"] == newest.made_by.version:
        return text
    return f"*Written about the results of {found['version']}:*\n\n{text}"


Lines: TypeAlias = CurvePanel | RangePanel

_EARLIER_IN_KEY = f"; {EARLIER.strip()}: by an earlier version"


def merge_plots(parts: Sequence[Part]) -> Plot | None:
    """The newest part's plot, plus lines that only earlier parts have, marked by an asterisk."""
    shown: Plot | None = None
    for plot in (part.plot for part in parts if part.plot is not None):
        shown = plot if shown is None else _with_earlier(shown, plot)
    return shown


def _with_earlier(newer: Plot, older: Plot) -> Plot:
    if type(newer.panels[0]) is not type(older.panels[0]) or not isinstance(newer.panels[0], Lines):
        return newer
    panels: dict[str, Lines] = {panel.title: panel for panel in newer.panels if isinstance(panel, Lines)}
    for panel in older.panels:
        if isinstance(panel, Lines):
            panels[panel.title] = _with_lines(panels.get(panel.title), panel)
    if not any(line.name.endswith(EARLIER) for panel in panels.values() for line in panel.lines):
        return newer
    usual = CURVES_KEY if isinstance(newer.panels[0], CurvePanel) else RANGES_KEY
    key = (newer.key or usual).removesuffix(_EARLIER_IN_KEY)
    return replace(newer, panels=tuple(panels.values()), key=key + _EARLIER_IN_KEY)


def _with_lines(newer: Lines | None, older: Lines) -> Lines:
    known = newer.lines if newer else ()
    names = {line.name.removesuffix(EARLIER) for line in known}
    missing = [line for line in older.lines if line.name.removesuffix(EARLIER) not in names]
    more = [replace(line, name=line.name.removesuffix(EARLIER) + EARLIER) for line in missing]
    return replace(newer or older, lines=(*known, *more))  # type: ignore[arg-type]  # lines of the panel's own kind
