"""Plots of experiments: error against something, and spreads of methods side by side; one SVG file each.

The file carries its own style, for light and dark pages, and a line that says what its marks mean.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from tactile_lab.evaluation.spread import quantile
from tactile_lab.experiments.summary import Group
from tactile_lab.geometry.contacts import Array
from tactile_lab.report.svg import Chart, Frame, tick_label

WIDTH = 920.0
_GAP, _TITLE_HEIGHT, _LEGEND_HEIGHT, _PANEL_TITLE = 18.0, 30.0, 24.0, 20.0
_LEGEND_LETTER = 6.7
_KEY_HEIGHT, _BESIDE = 20.0, 9.0
_CURVES_KEY = "dot: median; band: up to the 90th percentile"
_RANGES_KEY = "dot: median; thick line: up to the 90th percentile; thin line: up to the largest value"
_LARGEST_mm = 300.0
"""Axes end here: what is farther off is simply wrong."""

_COLOURS = {
    "joint": 0,
    "thesis-pf": 1,
    "particle": 2,
    "icp": 3,
    "thesis-pf-graph": 4,
    "odometry": 5,
    "known-pose": 6,
    "chosen by evidence": 0,
    "ours": 0,
    "particle, no graph": 3,
}
"""Names that have the same colour in every plot; the others take those that are left."""

STYLE = """
:root { --page:#ffffff; --ink:#1b2330; --soft:#5a6678; --grid:#e6e9ee;
  --s0:#1d5fa8; --s1:#c2570c; --s2:#1a8f6a; --s3:#8a4fbf; --s4:#b3261e; --s5:#7a6a00; --s6:#5a6678; }
@media (prefers-color-scheme: dark) { :root { --page:#191f28; --ink:#e7ebf1; --soft:#9aa7b8; --grid:#2a323e;
  --s0:#79b4f2; --s1:#ffab5c; --s2:#5fd0a6; --s3:#c79bf2; --s4:#ff8f85; --s5:#dccb5a; --s6:#9aa7b8; } }
.page { fill:var(--page); }
text { fill:var(--soft); font:11.5px system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
text.title { fill:var(--ink); font-size:15px; font-weight:600; }
text.panel { fill:var(--ink); font-weight:600; font-size:12.5px; }
text.name { fill:var(--ink); } text.axis { font-size:12px; }
.grid { stroke:var(--grid); stroke-width:1; }
path.line { fill:none; stroke-width:2.2; stroke-linejoin:round; } .band { opacity:.13; }
line.reach { stroke-width:1.2; opacity:.6; } line.p90 { stroke-width:6; opacity:.38; }
.dot { stroke:var(--page); stroke-width:1.2; }
"""


@dataclass(frozen=True)
class Series:
    """A line with a band: median, and ninetieth percentile above it.

    Attributes:
        name: in the legend.
        x: shape (n,).
        median, p90: shape (n,), infinite where too many runs have no figure.
    """

    name: str
    x: Array
    median: Array
    p90: Array


@dataclass(frozen=True)
class CurvePanel:
    """One chart of curves, with a logarithmic vertical axis.

    Attributes:
        title: above it.
        x_label, y_label: of the axes.
        series: the curves.
        log_x: the horizontal axis is logarithmic too.
    """

    title: str
    x_label: str
    y_label: str
    series: Sequence[Series]
    log_x: bool = False


@dataclass(frozen=True)
class RangePanel:
    """One chart of spreads.

    Attributes:
        title: above it.
        label: of the horizontal, logarithmic axis.
        key: name of the figure shown.
        groups: name and runs of each line.
    """

    title: str
    label: str
    key: str
    groups: Sequence[tuple[str, Group]]


def curve_of(name: str, groups: Sequence[Group], x: str, key: str) -> Series:
    """The curve of groups that differ in the setting ``x``, in its order."""
    ordered = sorted(groups, key=lambda group: float(group[x]))
    values = [group.values(key) for group in ordered]
    return Series(
        name,
        np.array([float(group[x]) for group in ordered]),
        np.array([quantile(found, 0.5) for found in values]),
        np.array([quantile(found, 0.9) for found in values]),
    )


def curves_svg(title: str, panels: Sequence[CurvePanel], columns: int = 2) -> str:
    """Charts of curves side by side, with one legend and the same vertical axis."""
    columns = min(columns, len(panels))
    names = list(dict.fromkeys(series.name for panel in panels for series in panel.series))
    reached = [values for panel in panels for series in panel.series for values in (series.median, series.p90)]
    limits = _log_limits(np.concatenate(reached))
    charts = [_curves(panel, names, limits, _panel_width(columns)) for panel in panels]
    return _sheet(title, charts, [panel.title for panel in panels], columns, names, _CURVES_KEY)


def ranges_svg(title: str, panels: Sequence[RangePanel], columns: int = 2) -> str:
    """Charts of spreads side by side, all with the same axis."""
    columns = min(columns, len(panels))
    names = list(dict.fromkeys(name for panel in panels for name, _ in panel.groups))
    known = [group.spread(panel.key) for panel in panels for _, group in panel.groups]
    limits = _log_limits(np.array([value for spread in known for value in (spread.median, spread.largest)]))
    charts = [_ranges(panel, names, limits, _panel_width(columns)) for panel in panels]
    return _sheet(title, charts, [panel.title for panel in panels], columns, [], _RANGES_KEY)


def _log_limits(values: Array) -> tuple[float, float]:
    """Decimal logarithms of the ends of an axis that shows the values, at least from 1 to 10."""
    finite = np.clip(values[np.isfinite(values)], 0.05, _LARGEST_mm)
    low, high = min(1.0, *finite, 1.0), max(10.0, *finite, 10.0)
    return math.log10(low) - 0.1, math.log10(high) + 0.06


def _panel_width(columns: int) -> float:
    return (WIDTH - _GAP * (columns + 1)) / columns


def _curves(panel: CurvePanel, names: list[str], limits: tuple[float, float], width: float) -> Chart:
    x = _across(panel, np.concatenate([series.x for series in panel.series]))
    margin = 0.03 * max(float(np.ptp(x)), 1e-9)
    chart = Chart(Frame(width, 250), (float(x.min()) - margin, float(x.max()) + margin), limits)
    _curve_axes(chart, panel, limits)
    for series in panel.series:
        colour = _colour(series.name, names)
        fine = np.isfinite(series.median)
        places = _across(panel, series.x)[fine]
        line, reach = (np.column_stack([places, _log(values[fine], limits)]) for values in (series.median, series.p90))
        band = chart.trace(np.vstack([line, reach[::-1]]), closed=True)
        chart.add(f'<path class="band" fill="{colour}" d="{band}"/>')
        chart.add(f'<path class="line" stroke="{colour}" d="{chart.trace(line)}"/>')
        for place, at, value in zip(series.x[fine], line, series.median[fine], strict=True):
            chart.dot(at, "dot", tip=f"{series.name}, {place:g}: {value:.2f}", style=f"fill:{colour}")
    return chart


def _across(panel: CurvePanel, x: Array) -> Array:
    return np.asarray(np.log10(x)) if panel.log_x else x


def _log(values: Array, limits: tuple[float, float]) -> Array:
    return np.clip(np.log10(np.maximum(values, 1e-9)), *limits)


def _curve_axes(chart: Chart, panel: CurvePanel, limits: tuple[float, float]) -> None:
    frame, base = chart.frame, chart.frame.height - chart.frame.bottom
    for value in _decade_ticks(limits):
        chart.segment(np.array([chart.x.low, math.log10(value)]), np.array([chart.x.high, math.log10(value)]), "grid")
        chart.label(chart.x.low, math.log10(value), tick_label(value), "tick", "end", dy=4)
    ends = (chart.x.low, chart.x.high)
    places = [math.log10(v) for v in _decade_ticks(ends)] if panel.log_x else chart.x.ticks(8)
    for place in places:
        chart.segment(np.array([place, limits[0]]), np.array([place, limits[1]]), "grid")
        text = tick_label(10**place if panel.log_x else place)
        chart.label(place, limits[0], text, "tick", "middle", dy=16)
    middle = (frame.top + base) / 2
    chart.label(sum(ends) / 2, limits[0], panel.x_label, "axis", "middle", dy=34)
    turned = f'<text class="axis" x="12" y="{middle:.1f}" text-anchor="middle">{escape(panel.y_label)}</text>'
    chart.add(f'<g transform="rotate(-90 12 {middle:.1f})">{turned}</g>')


def _ranges(panel: RangePanel, names: list[str], limits: tuple[float, float], width: float) -> Chart:
    count = len(panel.groups)
    frame = Frame(width, 48.0 + 24.0 * count, left=132.0 + _BESIDE, right=62.0 + _BESIDE, top=8.0)
    chart = Chart(frame, limits, (count - 0.5, -0.5))
    for value in _decade_ticks(limits):
        chart.segment(np.array([math.log10(value), count - 0.5]), np.array([math.log10(value), -0.5]), "grid")
        chart.label(math.log10(value), count - 0.5, tick_label(value), "tick", "middle", dy=16)
    chart.label((limits[0] + limits[1]) / 2, count - 0.5, panel.label, "axis", "middle", dy=34)
    for line, (name, group) in enumerate(panel.groups):
        _range(chart, line, name, group, panel.key, _colour(name, names))
    return chart


def _range(chart: Chart, line: int, name: str, group: Group, key: str, colour: str) -> None:
    spread = group.spread(key)
    values = np.array([spread.median, spread.p90, spread.largest])
    median, p90, largest = _log(values, (chart.x.low, chart.x.high)).tolist()
    chart.label(chart.x.low, line, name, "name", "end", dx=-_BESIDE, dy=4)
    for end, kind in ((largest, "reach"), (p90, "p90")):
        chart.segment(np.array([median, line]), np.array([end, line]), kind, f"stroke:{colour}")
    chart.dot((median, line), "dot", radius=5, tip=f"{name}: {spread.text()}", style=f"fill:{colour}")
    chart.label(chart.x.high, line, f"{100 * group.failed_share:.0f} % fail", "tick", "start", dx=_BESIDE, dy=4)


def _decade_ticks(limits: tuple[float, float]) -> list[float]:
    powers = range(math.floor(limits[0]), math.ceil(limits[1]) + 1)
    values = [step * 10.0**power for power in powers for step in (1, 2, 5)]
    return [value for value in values if limits[0] <= math.log10(value) <= limits[1]]


def _colour(name: str, names: list[str]) -> str:
    taken = {_COLOURS[other] for other in names if other in _COLOURS}
    left = [index for index in range(7) if index not in taken] or [6]
    others = [other for other in names if other not in _COLOURS]
    index = _COLOURS[name] if name in _COLOURS else left[others.index(name) % len(left)]
    return f"var(--s{index})"


def _sheet(
    title: str, charts: Sequence[Chart], titles: Sequence[str], columns: int, legend: list[str], key: str
) -> str:
    """All charts on one page, row by row, and below them what the marks mean."""
    parts = [f'<text class="title" x="{_GAP}" y="22">{escape(title)}</text>', *_legend(legend)]
    top = _TITLE_HEIGHT + (_legend_lines(legend) * _LEGEND_HEIGHT if legend else 6.0)
    for first in range(0, len(charts), columns):
        row = list(zip(charts, titles, strict=True))[first : first + columns]
        for column, (chart, name) in enumerate(row):
            left = _GAP + column * (_panel_width(columns) + _GAP)
            parts.append(f'<text class="panel" x="{left:.0f}" y="{top + 14:.0f}">{escape(name)}</text>')
            parts.append(_placed(chart, name, left, top + _PANEL_TITLE))
        top += _PANEL_TITLE + max(chart.frame.height for chart, _ in row) + _GAP
    parts.append(f'<text x="{_GAP:.0f}" y="{top:.0f}">{escape(key)}</text>')
    top += _KEY_HEIGHT
    size = f'viewBox="0 0 {WIDTH:.0f} {top:.0f}" width="{WIDTH:.0f}" height="{top:.0f}"'
    page = f'<rect class="page" width="{WIDTH:.0f}" height="{top:.0f}"/>'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}><style>{STYLE}</style>{page}{"".join(parts)}</svg>\n'


def _placed(chart: Chart, title: str, left: float, top: float) -> str:
    size = f'x="{left:.1f}" y="{top:.1f}" width="{chart.frame.width:.1f}" height="{chart.frame.height:.1f}"'
    return chart.text(title, "").replace("<svg ", f"<svg {size} ", 1)


def _legend_places(names: list[str]) -> list[tuple[float, int]]:
    """Left edge and line of each entry."""
    places: list[tuple[float, int]] = []
    left, line = _GAP, 0
    for name in names:
        width = 34.0 + _LEGEND_LETTER * len(name)
        if left + width > WIDTH - _GAP and left > _GAP:
            left, line = _GAP, line + 1
        places.append((left, line))
        left += width
    return places


def _legend_lines(names: list[str]) -> int:
    return 1 + _legend_places(names)[-1][1]


def _legend(names: list[str]) -> list[str]:
    parts = []
    for index, (left, line) in enumerate(_legend_places(names)):
        y = _TITLE_HEIGHT + 12 + line * _LEGEND_HEIGHT
        parts.append(
            f'<line x1="{left:.0f}" y1="{y - 4:.0f}" x2="{left + 16:.0f}" y2="{y - 4:.0f}" '
            f'stroke="{_colour(names[index], names)}" stroke-width="3"/>'
            f'<text class="name" x="{left + 22:.0f}" y="{y:.0f}">{escape(names[index])}</text>'
        )
    return parts
