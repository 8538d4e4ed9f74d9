"""The claims about the program, where their figures are found in the stored results, and whether these meet the goals.

The claims are written by hand (``docs/results/claims.yaml``). Their figures are taken from the tables, so that they
cannot be older than these.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.errors import ConfigurationError
from tactile_lab.experiments.plot_data import RANGES_KEY, Plot, Range, RangePanel
from tactile_lab.experiments.results.stored_result import Part, StoredResult, Table

MET, MISSED = "met", "**missed**"
WIDE, NARROW = 920.0, 600.0
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?|∞")
_BESIDE = re.compile(r"(?<=\d) (?=\d{3}\b)")
_PAIRS_KEY = "dot: median; line: up to the 95th percentile"
_FIGURES_KEY = "dot: the figure on the right"


class Place(StrictModel):
    """A row and a column of a stored result, in the newest table that has this column and exactly one such row.

    Attributes:
        result: name of the result.
        where: texts in the row, by the titles of their columns without units.
        column: title of the column; "" in a panel's rows.
    """

    result: str
    where: dict[str, str | int | float] = Field(default_factory=dict)
    column: str


class Goal(StrictModel):
    """A figure and the limit that it should meet.

    Attributes:
        what: the figure, described in words.
        place: where it is found.
        number: index among the cell's numbers; None shows the whole cell and uses the first.
        percent_of: column of which it is a percentage.
        over: where the divisor is found.
        unit: text after the numbers.
        asked: the limit; None if there is none.
        at_least: whether the limit is a lower bound.
    """

    what: str
    place: Place
    number: int | None = None
    percent_of: str | None = None
    over: Place | None = None
    unit: str = ""
    asked: float | None = None
    at_least: bool = False


class Panel(StrictModel):
    """A chart of a claim's plot.

    Attributes:
        title: above it.
        label: of its axis.
        place: common to all rows, without the column that differs.
        by: the column that differs.
        names: its texts from top to bottom, and the words to show for them.
        number: index of the cell's number to show; None for a spread, or the first.
        asked: the limit of the dots; None where nothing was.
    """

    title: str
    label: str
    place: Place
    by: str
    names: dict[str, str]
    number: int | None = None
    asked: float | None = None


class Claim(StrictModel):
    """One claim.

    Attributes:
        name: name of its picture.
        title: title of its section.
        text: what was reached and what was not, in Markdown.
        pages: results with more details.
        goals: its figures and limits.
        panels: of its plot.
    """

    name: str
    title: str
    text: str
    pages: list[str]
    goals: list[Goal] = Field(default_factory=list)
    panels: list[Panel]


class Headline(StrictModel):
    """A sentence of the repository's front page.

    Attributes:
        text: in Markdown; ``{0}`` stands for the first figure.
        goals: its figures.
    """

    text: str
    goals: list[Goal]


class Claims(StrictModel):
    """The overview.

    Attributes:
        headlines: what the repository's front page says of the results.
        intro: text above the claims.
        claims: in their order.
        outro: text below the claims.
    """

    headlines: list[Headline] = Field(default_factory=list)
    intro: str
    claims: list[Claim]
    outro: str


@dataclass(frozen=True)
class Found:
    """A cell of a stored result.

    Attributes:
        text: text of the cell.
        row: texts of its row, by the titles of their columns.
        part: the part that contains it.
    """

    text: str
    row: Mapping[str, str]
    part: Part


@dataclass(frozen=True)
class Reached:
    """A goal's figure.

    Attributes:
        text: with its unit.
        verdict: met, missed, or "" if there is no limit.
        part: the part of the result that contains it.
    """

    text: str
    verdict: str
    part: Part


def judge_goal(goal: Goal, results: Mapping[str, StoredResult]) -> Reached:
    """The figure of a goal. Raises ConfigurationError if it is not found."""
    found = find(goal.place, results)
    numbers = numbers_in(found.text)
    if not numbers:
        raise ConfigurationError("holds no number", where=_words(goal.place), hint="Correct docs/results/claims.yaml")
    value = numbers[goal.number or 0]
    text = found.text if goal.number is None else f"{value:g}"
    if goal.percent_of is not None:
        value = 100 * value / numbers_in(found.row[goal.percent_of])[0]
        text = f"{round(value, 1):g}"
    if goal.over is not None:
        value /= numbers_in(find(goal.over, results).text)[0]
        text = f"{value:.2f}"
    return Reached(f"{text} {goal.unit}".strip(), _verdict(goal, value), found.part)


def _verdict(goal: Goal, value: float) -> str:
    if goal.asked is None:
        return ""
    return MET if (value >= goal.asked if goal.at_least else value <= goal.asked) else MISSED


def plot(claim: Claim, results: Mapping[str, StoredResult]) -> Plot:
    """The plot of a claim. Raises ConfigurationError if a row is missing."""
    panels = tuple(_panel(panel, results) for panel in claim.panels)
    notes = [line.note.count(" / ") for panel in panels for line in panel.lines]
    key = {0: _FIGURES_KEY, 1: _PAIRS_KEY}.get(max(notes), RANGES_KEY)
    asked = "; dashed: asked" if any(panel.asked for panel in panels) else ""
    return Plot(panels, columns=2, key=key + asked, width=WIDE if len(panels) > 1 else NARROW)


def _panel(panel: Panel, results: Mapping[str, StoredResult]) -> RangePanel:
    lines = [_line(panel, name, shown, results) for name, shown in panel.names.items()]
    return RangePanel(panel.title, panel.label, tuple(lines), panel.asked)


def _line(panel: Panel, name: str, shown: str, results: Mapping[str, StoredResult]) -> Range:
    place = panel.place.model_copy(update={"where": {**panel.place.where, panel.by: name}})
    text = find(place, results).text
    values = numbers_in(text)
    if panel.number is None and " / " in text:
        median, p90, largest = (*values, values[-1])[:3]
        return Range(shown, median, p90, largest, text)
    value = values[panel.number or 0]
    return Range(shown, value, value, value, text if panel.number is None else f"{value:g}")


def find(place: Place, results: Mapping[str, StoredResult]) -> Found:
    """The cell at a place. Raises ConfigurationError if there is none, or more than one."""
    parts = results[place.result].parts if place.result in results else ()
    tables = [(table, part) for part in parts for table in part.tables if place.column in table.head]
    told = [(table, part) for table, part in tables if _tells(table, place)]
    for table, part in (*told, *tables):
        rows = [dict(zip(table.head, row, strict=True)) for row in table.rows]
        found = [row for row in rows if _fits(row, place.where)]
        if len(found) == 1:
            return Found(found[0][place.column], found[0], part)
    hint = "Correct docs/results/claims.yaml, or store the result again"
    raise ConfigurationError("no such row, or several", where=_words(place), hint=hint)


def _tells(table: Table, place: Place) -> bool:
    """Whether the place names all keys of the row: a single shape must not be mistaken for all shapes together."""
    return all(title in place.where or title.partition(",")[0] in place.where for title in table.head[: table.keys])


def _fits(row: Mapping[str, str], where: Mapping[str, str | int | float]) -> bool:
    short = {title.partition(",")[0]: text for title, text in row.items()}
    return all(row.get(name, short.get(name)) == str(value) for name, value in where.items())


def _words(place: Place) -> str:
    return ", ".join([place.result, *(f"{name} {value}" for name, value in place.where.items()), place.column])


def numbers_in(text: str) -> list[float]:
    """The numbers of a cell, without spaces between thousands."""
    return list(_numbers(_BESIDE.sub("", text)))


def _numbers(text: str) -> Iterator[float]:
    for found in _NUMBER.findall(text):
        yield math.inf if found == "∞" else float(found)
