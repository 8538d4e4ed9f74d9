"""The contents of a plot as plain numbers, kept in a stored result; the picture on the page is drawn from them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any, Self, TypeAlias

CURVES_KEY = "mark: median; band: up to the 90th percentile"
DRAWINGS_KEY = "lines: outlines, to scale; dots: contacts"
SURFACES_KEY = "shade: light is low, dark is high; lines: edges of the true surface; dots: contacts"
RANGES_KEY = "dot: median; thick line: up to the 90th percentile; thin line: up to the largest value"


@dataclass(frozen=True)
class Series:
    """A line with a band: median, and ninetieth percentile above it.

    Attributes:
        name: in the legend.
        x: positions, ascending.
        median, p90: values at these positions; infinite if too many runs have no figure.
    """

    name: str
    x: tuple[float, ...]
    median: tuple[float, ...]
    p90: tuple[float, ...]

    @classmethod
    def from_json(cls, found: Mapping[str, Any]) -> Self:
        """The inverse of :func:`panel_json`. Raises KeyError, TypeError or ValueError."""
        return cls(found["name"], *(tuple(map(float, found[name])) for name in ("x", "median", "p90")))


@dataclass(frozen=True)
class Range:
    """A dot with a line to its right; values are infinite if too many runs have no figure.

    Attributes:
        name: text on its left.
        median, p90, largest: of all runs.
        note: text on its right, such as the share of failures.
    """

    name: str
    median: float
    p90: float
    largest: float
    note: str = ""

    @classmethod
    def from_json(cls, found: Mapping[str, Any]) -> Self:
        """The inverse of :func:`panel_json`. Raises KeyError, TypeError or ValueError."""
        median, p90, largest = (float(found[name]) for name in ("median", "p90", "largest"))
        return cls(found["name"], median, p90, largest, found["note"])


@dataclass(frozen=True)
class CurvePanel:
    """One chart of curves, with a logarithmic vertical axis.

    Attributes:
        title: text above it.
        x_label, y_label: of the axes.
        lines: the curves.
        log_x: whether the horizontal axis is logarithmic too.
    """

    title: str
    x_label: str
    y_label: str
    lines: tuple[Series, ...]
    log_x: bool = False


@dataclass(frozen=True)
class RangePanel:
    """One chart of spreads.

    Attributes:
        title: text above it.
        label: of the horizontal, logarithmic axis.
        lines: from top to bottom.
        asked: the limit for the dots, shown as a dashed vertical line.
    """

    title: str
    label: str
    lines: tuple[Range, ...]
    asked: float | None = None


@dataclass(frozen=True)
class Stroke:
    """A drawn line.

    Attributes:
        name: in the legend.
        points: x and y in millimetres.
        closed: whether the last point joins the first.
    """

    name: str
    points: tuple[tuple[float, float], ...]
    closed: bool = True

    @classmethod
    def from_json(cls, found: Mapping[str, Any]) -> Self:
        """The inverse of :func:`panel_json`. Raises KeyError, TypeError or ValueError."""
        return cls(found["name"], _pairs(found["points"]), bool(found["closed"]))


@dataclass(frozen=True)
class DrawingPanel:
    """Outlines and contacts drawn to scale; all panels of a plot have the same scale.

    Attributes:
        title: text above it.
        strokes: the lines, from the bottom to the top.
        dots: x and y of contacts in millimetres.
    """

    title: str
    strokes: tuple[Stroke, ...]
    dots: tuple[tuple[float, float], ...] = ()


Facet: TypeAlias = tuple[float, ...]
"""A triangle in the picture: x and y of its three corners in millimetres, then its shade, 0 light to 1 dark."""


@dataclass(frozen=True)
class SurfacePanel:
    """A surface seen from the side and above, shaded by a value; all panels of a plot have the same scale.

    Attributes:
        title: text above it.
        facets: from the back to the front.
        edges: of the true surface, as x and y of both ends in the picture, millimetres.
        dots: x and y in the picture, millimetres.
        names: a text, and its place in the picture: x and y in millimetres.
    """

    title: str
    facets: tuple[Facet, ...]
    edges: tuple[tuple[float, ...], ...] = ()
    dots: tuple[tuple[float, float], ...] = ()
    names: tuple[tuple[str, float, float], ...] = ()


Panel: TypeAlias = "CurvePanel | RangePanel | DrawingPanel | SurfacePanel"


@dataclass(frozen=True)
class Plot:
    """Charts of one kind, side by side.

    Attributes:
        panels: all of one kind.
        columns: number of panels in a row.
        key: explanation of the marks, "" for the usual one.
        width: width of the sheet, pixels.
    """

    panels: tuple[Panel, ...]
    columns: int = 2
    key: str = ""
    width: float = 920.0

    def as_json(self) -> dict[str, Any]:
        """Plain data; the inverse is :meth:`from_json`."""
        return {
            "kind": _kinds[type(self.panels[0])],
            "columns": self.columns,
            "key": self.key,
            "panels": [panel_json(one) for one in self.panels],
        }

    @classmethod
    def from_json(cls, found: Mapping[str, Any]) -> Self:
        """Raises KeyError, TypeError or ValueError for what :meth:`as_json` did not write."""
        panels = tuple(map(_panel_of[found["kind"]], found["panels"]))
        return cls(panels, int(found["columns"]), found["key"])


def _curve_panel(found: Mapping[str, Any]) -> CurvePanel:
    return CurvePanel(**{**found, "lines": tuple(map(Series.from_json, found["lines"]))})


def _range_panel(found: Mapping[str, Any]) -> RangePanel:
    return RangePanel(**{**found, "lines": tuple(map(Range.from_json, found["lines"]))})


def _drawing_panel(found: Mapping[str, Any]) -> DrawingPanel:
    return DrawingPanel(found["title"], tuple(map(Stroke.from_json, found["strokes"])), _pairs(found["dots"]))


def _surface_panel(found: Mapping[str, Any]) -> SurfacePanel:
    facets, edges = (tuple(tuple(map(float, row)) for row in found[name]) for name in ("facets", "edges"))
    names = tuple((str(text), float(x), float(y)) for text, x, y in found["names"])
    return SurfacePanel(found["title"], facets, edges, _pairs(found["dots"]), names)


def _pairs(found: Sequence[Sequence[float]]) -> tuple[tuple[float, float], ...]:
    return tuple((float(x), float(y)) for x, y in found)


_panel_of: Mapping[str, Any] = {
    "curves": _curve_panel,
    "ranges": _range_panel,
    "drawings": _drawing_panel,
    "surfaces": _surface_panel,
}
_kinds: Mapping[type, str] = {
    CurvePanel: "curves",
    RangePanel: "ranges",
    DrawingPanel: "drawings",
    SurfacePanel: "surfaces",
}


def panel_json(panel: Panel) -> dict[str, Any]:
    """A panel as plain data: numbers with four digits, infinity as a text, because JSON cannot represent it."""
    return {field.name: _plain(getattr(panel, field.name)) for field in fields(panel)}


def _plain(value: Any) -> Any:
    if isinstance(value, Series | Range | Stroke):
        return _plain(asdict(value))
    if isinstance(value, Mapping):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_plain(part) for part in value]
    if isinstance(value, float):
        return float(f"{value:.4g}") if math.isfinite(value) else "inf"
    return value
