"""Plots of experiments: curves of an error, and spreads of methods side by side; one SVG file each.

A file contains its own style, for light and dark pages, and a line that explains its marks. Curves differ in marks and
dashes as well as in colour, so that a grey print remains readable.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.evaluation.spread import number
from tactile_lab.experiments.plot_data import (
    CURVES_KEY,
    RANGES_KEY,
    CurvePanel,
    DrawingPanel,
    Plot,
    Range,
    RangePanel,
    Series,
    SurfacePanel,
)
from tactile_lab.experiments.plot_drawings import drawings_svg
from tactile_lab.experiments.plot_sheet import LETTER_px, Look, Sheet
from tactile_lab.experiments.plot_surfaces import surfaces_svg
from tactile_lab.report.svg import Chart, Frame, tick_label

_BESIDE = 9.0
_LEAST_SPAN = 0.9
"""Smallest number of decades on an axis."""
_FINE_SPAN = 1.2
"""An axis with fewer decades has finer ticks."""


def draw(title: str, plot: Plot) -> str:
    """Draw the plot as an SVG file."""
    curves = [panel for panel in plot.panels if isinstance(panel, CurvePanel)]
    ranges = [panel for panel in plot.panels if isinstance(panel, RangePanel)]
    drawings = [panel for panel in plot.panels if isinstance(panel, DrawingPanel)]
    surfaces = [panel for panel in plot.panels if isinstance(panel, SurfacePanel)]
    sheet = Sheet(title, plot.width, min(plot.columns, len(plot.panels)), [panel.title for panel in plot.panels])
    if surfaces:
        return surfaces_svg(sheet, surfaces, plot.key)
    if drawings:
        return drawings_svg(sheet, drawings, plot.key)
    return _curves_svg(sheet, curves, plot.key) if curves else _ranges_svg(sheet, ranges, plot.key)


def _curves_svg(sheet: Sheet, panels: Sequence[CurvePanel], key: str) -> str:
    """Charts with one legend and the same vertical axis."""
    look = Look([series.name for panel in panels for series in panel.lines])
    limits = _log_limits(value for panel in panels for series in panel.lines for value in (*series.median, *series.p90))
    charts = [_curves(panel, look, limits, sheet.panel_width) for panel in panels]
    return sheet.svg(charts, key or CURVES_KEY, look)


def _ranges_svg(sheet: Sheet, panels: Sequence[RangePanel], key: str) -> str:
    """Charts with the same horizontal axis."""
    look = Look([line.name for panel in panels for line in panel.lines], distinct=False)
    shown = [value for panel in panels for line in panel.lines for value in (line.median, line.largest)]
    limits = _log_limits([*shown, *(panel.asked for panel in panels if panel.asked)])
    longest = max(len(line.note) for panel in panels for line in panel.lines)
    ends = max(90.0, LETTER_px * max(map(len, look.names))) + _BESIDE, max(60.0, LETTER_px * longest) + _BESIDE
    charts = [_ranges(panel, look, limits, sheet.panel_width, ends) for panel in panels]
    return sheet.svg(charts, key or RANGES_KEY)


def _log_limits(values: Iterable[float]) -> tuple[float, float]:
    """Decimal logarithms of the ends of an axis for these values; infinite values are drawn at its end."""
    finite = [min(max(value, 0.01), 30_000.0) for value in values if 0.0 < value < math.inf] or [1.0, 10.0]
    low, high = math.log10(min(finite)), math.log10(max(finite))
    missing = max(0.0, _LEAST_SPAN - (high - low)) / 2
    return low - missing - 0.08, high + missing + 0.06


def _curves(panel: CurvePanel, look: Look, limits: tuple[float, float], width: float) -> Chart:
    x = _across(panel, np.concatenate([series.x for series in panel.lines]))
    margin = 0.03 * max(float(np.ptp(x)), 1e-9)
    chart = Chart(Frame(width, 250), (float(x.min()) - margin, float(x.max()) + margin), limits)
    _curve_axes(chart, panel, limits)
    for series in panel.lines:
        _curve(chart, panel, series, look, limits)
    return chart


def _curve(chart: Chart, panel: CurvePanel, series: Series, look: Look, limits: tuple[float, float]) -> None:
    colour, median = look.colour(series.name), np.array(series.median)
    fine = np.isfinite(median)
    places = _across(panel, np.array(series.x))[fine]
    line, reach = (np.column_stack([places, _log(np.array(values)[fine], limits)]) for values in (median, series.p90))
    band = chart.trace(np.vstack([line, reach[::-1]]), closed=True)
    chart.add(f'<path class="band" fill="{colour}" d="{band}"/>')
    chart.add(f'<path class="line" stroke="{colour}"{look.dash(series.name)} d="{chart.trace(line)}"/>')
    for place, at, value in zip(np.array(series.x)[fine], line, median[fine], strict=True):
        tip = f"{series.name}, {place:g}: {value:.2f}"
        chart.add(look.mark(chart.x(at[0]), chart.y(at[1]), series.name, tip))


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


def _ranges(
    panel: RangePanel, look: Look, limits: tuple[float, float], width: float, ends: tuple[float, float]
) -> Chart:
    count = len(panel.lines)
    frame = Frame(width, 48.0 + 24.0 * count, left=ends[0], right=ends[1], top=8.0)
    chart = Chart(frame, limits, (count - 0.5, -0.5))
    for value in _decade_ticks(limits):
        _upright(chart, math.log10(value), count, "grid")
        chart.label(math.log10(value), count - 0.5, tick_label(value), "tick", "middle", dy=16)
    chart.label((limits[0] + limits[1]) / 2, count - 0.5, panel.label, "axis", "middle", dy=34)
    if panel.asked:
        _upright(chart, math.log10(panel.asked), count, "asked")
    for place, line in enumerate(panel.lines):
        _range(chart, place, line, look.colour(line.name))
    return chart


def _upright(chart: Chart, at: float, count: int, kind: str) -> None:
    chart.segment(np.array([at, count - 0.5]), np.array([at, -0.5]), kind)


def _range(chart: Chart, place: int, line: Range, colour: str) -> None:
    values = np.array([line.median, line.p90, line.largest])
    median, p90, largest = _log(values, (chart.x.low, chart.x.high)).tolist()
    chart.label(chart.x.low, place, line.name, "name", "end", dx=-_BESIDE, dy=4)
    for end, kind in ((largest, "reach"), (p90, "p90")):
        chart.segment(np.array([median, place]), np.array([end, place]), kind, f"stroke:{colour}")
    tip = f"{line.name}: {' / '.join(number(value, 2) for value in values.tolist())}"
    if line.median > 0.0:
        chart.dot((median, place), "dot", radius=5, tip=tip, style=f"fill:{colour}")
    else:  # it lies outside the axis
        chart.label(chart.x.low, place, "0", "name", "start", dx=4, dy=4)
    chart.label(chart.x.high, place, line.note, "tick", "start", dx=_BESIDE, dy=4)


def _decade_ticks(limits: tuple[float, float]) -> list[float]:
    powers = range(math.floor(limits[0]), math.ceil(limits[1]) + 1)
    steps = (1, 2, 5) if limits[1] - limits[0] > _FINE_SPAN else (1, 1.5, 2, 3, 4, 6, 8)
    values = [step * 10.0**power for power in powers for step in steps]
    return [value for value in values if limits[0] <= math.log10(value) <= limits[1]]
