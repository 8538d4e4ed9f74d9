"""Plots of experiments that are surfaces, seen from the side and above, shaded by a value.

The shades differ in lightness, evenly, so that a grey print shows the same.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.experiments.plot_data import SURFACES_KEY, Facet, SurfacePanel
from tactile_lab.experiments.plot_sheet import Sheet
from tactile_lab.report.svg import Chart, Frame

_SHADES = np.array([[253, 231, 170], [94, 178, 140], [43, 107, 141], [58, 24, 92]], dtype=float)
"""Colours of the shades 0, 1/3, 2/3 and 1, each darker than the one before."""
_MARGIN = 0.05
_RATIOS = (0.55, 1.1)
_SCALE_mm = 20.0


def surfaces_svg(sheet: Sheet, panels: Sequence[SurfacePanel], key: str) -> str:
    """All surfaces at one scale, the first with a bar that shows it."""
    middle_span = [_middle_and_span(panel) for panel in panels]
    span = np.max([span for _, span in middle_span], axis=0) * (1 + 2 * _MARGIN)
    charts = [
        _surface(panel, middle, span, sheet.panel_width) for panel, (middle, _) in zip(panels, middle_span, strict=True)
    ]
    _scale_bar(charts[0])
    return sheet.svg(charts, key or SURFACES_KEY)


def _middle_and_span(panel: SurfacePanel) -> tuple[Array, Array]:
    corners = [np.reshape(facet[:6], (3, 2)) for facet in panel.facets]
    others = [np.reshape(rows, (-1, 2)) for rows in (panel.dots, panel.edges)]
    points = np.vstack([*others, *corners, *([] if panel.facets else [np.zeros((1, 2))])])
    return (points.min(axis=0) + points.max(axis=0)) / 2, np.maximum(np.ptp(points, axis=0), 1.0)


def _surface(panel: SurfacePanel, middle: Array, span: Array, width: float) -> Chart:
    frame = Frame(width, width, left=8, right=8, top=6, bottom=18)
    inner = width - frame.left - frame.right
    height = inner * float(np.clip(span[1] / span[0], *_RATIOS))
    half = np.array([inner, height]) * max(span[0] / inner, span[1] / height) / 2
    (left, bottom), (right, top) = middle - half, middle + half
    whole = Frame(width, height + frame.top + frame.bottom, frame.left, frame.right, frame.top, frame.bottom)
    chart = Chart(whole, (left, right), (bottom, top))
    for facet in panel.facets:
        _facet(chart, facet)
    for edge in np.reshape(panel.edges, (-1, 2, 2)):
        chart.segment(edge[0], edge[1], "grid", "stroke:var(--ink);stroke-width:1.2;stroke-dasharray:4 3")
    for dot in panel.dots:
        chart.dot(dot, "dot", radius=3.2, style="fill:#d7263d")
    for text, x, y in panel.names:
        chart.dot((x, y), "dot", radius=8, style="fill:var(--page)")
        chart.label(x, y, text, "name", "middle", dy=4)
    return chart


def _facet(chart: Chart, facet: Facet) -> None:
    colour = shade(facet[6])
    trace = chart.trace(np.reshape(facet[:6], (3, 2)), closed=True)
    chart.add(f'<path d="{trace}" fill="{colour}" stroke="{colour}" stroke-width="0.6"/>')


def shade(value: float) -> str:
    """The colour of a value from 0 (light) to 1 (dark), as CSS."""
    stops = np.linspace(0.0, 1.0, len(_SHADES))
    red, green, blue = (round(float(np.interp(value, stops, channel))) for channel in _SHADES.T)
    return f"#{red:02x}{green:02x}{blue:02x}"


def _scale_bar(chart: Chart) -> None:
    low, left = chart.y.low, chart.x.low
    ends = np.array([[left, low], [left + _SCALE_mm, low]])
    chart.segment(ends[0], ends[1], "grid", "stroke:var(--ink);stroke-width:2")
    chart.label(left, low, f"{_SCALE_mm:g} mm", "tick", "start", dy=14)
