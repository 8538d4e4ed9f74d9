"""Plots of experiments that are drawings: outlines and contacts to scale, side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.experiments.plot_data import DRAWINGS_KEY, DrawingPanel
from tactile_lab.experiments.plot_sheet import Look, Sheet
from tactile_lab.report.svg import Chart, Frame

_MARGIN, _TICKS = 0.06, 4
_RATIOS = (0.55, 1.0)


def drawings_svg(sheet: Sheet, panels: Sequence[DrawingPanel], key: str) -> str:
    """All drawings with one legend and one scale."""
    look = Look([stroke.name for panel in panels for stroke in panel.strokes])
    middle_span = [_middle_and_span(panel) for panel in panels]
    span = np.max([span for _, span in middle_span], axis=0) * (1 + 2 * _MARGIN)
    charts = [
        _drawing(panel, look, middle, span, sheet.panel_width)
        for panel, (middle, _) in zip(panels, middle_span, strict=True)
    ]
    return sheet.svg(charts, key or DRAWINGS_KEY, look)


def _middle_and_span(panel: DrawingPanel) -> tuple[Array, Array]:
    points = np.array([*panel.dots, *(point for stroke in panel.strokes for point in stroke.points)] or [(0.0, 0.0)])
    return (points.min(axis=0) + points.max(axis=0)) / 2, np.maximum(np.ptp(points, axis=0), 1.0)


def _drawing(panel: DrawingPanel, look: Look, middle: Array, span: Array, width: float) -> Chart:
    frame = Frame(width, width, left=34, right=8, top=6, bottom=24)
    inner = width - frame.left - frame.right
    height = inner * float(np.clip(span[1] / span[0], *_RATIOS))
    half = np.array([inner, height]) * max(span[0] / inner, span[1] / height) / 2
    (left, bottom), (right, top) = middle - half, middle + half
    chart = Chart(
        Frame(width, height + frame.top + frame.bottom, frame.left, frame.right, frame.top, frame.bottom),
        (left, right),
        (bottom, top),
    )
    chart.axes("", "", x_ticks=chart.x.ticks(_TICKS), wanted_y=_TICKS)
    for stroke in panel.strokes:
        points, colour = np.array(stroke.points).reshape(-1, 2), look.colour(stroke.name)
        trace = chart.trace(points, closed=stroke.closed)
        chart.add(f'<path class="line" stroke="{colour}"{look.dash(stroke.name)} d="{trace}"/>')
    for dot in panel.dots:
        chart.dot(dot, "dot", radius=3, style="fill:var(--ink)")
    return chart
