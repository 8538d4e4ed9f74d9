"""Means with their confidence intervals as one SVG file: a panel per metric, a line per method."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from tactile_lab.evaluation.comparison import Figure, MethodSummary
from tactile_lab.report.svg import Scale, tick_label

_PLOT, _RIGHT, _LINE, _HEAD, _FOOT = 560.0, 30.0, 24.0, 34.0, 26.0
_LEAST_LEFT, _LETTER = 170.0, 7.0
_LEGEND = "dot: mean; bar: its 95 % interval, cut off at 0; tick: largest value"
_STYLE = """
:root { --page:#ffffff; --ink:#1b2330; --soft:#5a6678; --grid:#e6e9ee; --mark:#1d5fa8; }
@media (prefers-color-scheme: dark) { :root { --page:#191f28; --ink:#e7ebf1; --soft:#9aa7b8; --grid:#2a323e;
  --mark:#79b4f2; } }
.page { fill:var(--page); } .grid { stroke:var(--grid); } .bar { stroke:var(--mark); stroke-width:3; }
.dot { fill:var(--mark); } .largest { stroke:var(--mark); stroke-width:1; opacity:.5; }
text { fill:var(--soft); font:12px system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
text.title { fill:var(--ink); font-weight:600; }
"""


def comparison_svg(summaries: Sequence[MethodSummary]) -> str:
    """Dots are means, bars their 95 % intervals, ticks the largest value; metrics without values are left out.

    No metric can be negative: an interval is cut off at zero.
    """
    count = len(summaries[0].figures)
    panels = [[(summary.method, summary.figures[index]) for summary in summaries] for index in range(count)]
    shown = [panel for panel in panels if any(figure.mean is not None for _, figure in panel)]
    left = max(_LEAST_LEFT, 20.0 + _LETTER * max(len(summary.method) for summary in summaries))
    parts, top = [], 8.0
    for panel in shown:
        parts += _panel(panel, left, top)
        top += _HEAD + _LINE * len(panel) + _FOOT
    parts.append(f'<text x="{left:g}" y="{top + 14:g}">{_LEGEND}</text>')
    width, height = left + _PLOT + _RIGHT, top + 26.0
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}">'
    page = '<rect class="page" width="100%" height="100%"/>'
    return "\n".join([head, f"<style>{_STYLE}</style>", page, *parts, "</svg>\n"])


def _panel(panel: Sequence[tuple[str, Figure]], left: float, top: float) -> list[str]:
    values = [value for _, figure in panel for value in _values(figure)]
    scale = Scale(0.0, 1.05 * (max(values) or 1.0), left, left + _PLOT)
    bottom = top + _HEAD + _LINE * len(panel)
    parts = [f'<text class="title" x="{left:g}" y="{top + 18:g}">{escape(panel[0][1].title)}</text>']
    for tick in scale.ticks():
        x = scale(tick)
        parts.append(f'<line class="grid" x1="{x:.1f}" y1="{top + 26:g}" x2="{x:.1f}" y2="{bottom:g}"/>')
        parts.append(f'<text x="{x:.1f}" y="{bottom + 15:g}" text-anchor="middle">{tick_label(tick)}</text>')
    for line, (method, figure) in enumerate(panel):
        parts += _line(method, figure, scale, top + _HEAD + _LINE * (line + 0.5))
    return parts


def _line(method: str, figure: Figure, scale: Scale, y: float) -> list[str]:
    parts = [f'<text x="{scale.start_px - 10:g}" y="{y + 4:g}" text-anchor="end">{escape(method)}</text>']
    if figure.mean is None or figure.spread is None:
        return parts
    largest = scale(figure.spread.largest)
    parts.append(f'<line class="largest" x1="{largest:.1f}" y1="{y - 6:g}" x2="{largest:.1f}" y2="{y + 6:g}"/>')
    if figure.mean.low is not None and figure.mean.high is not None:
        ends = scale(max(0.0, figure.mean.low)), scale(figure.mean.high)
        parts.append(f'<line class="bar" x1="{ends[0]:.1f}" y1="{y:g}" x2="{ends[1]:.1f}" y2="{y:g}"/>')
    parts.append(f'<circle class="dot" cx="{scale(figure.mean.mean):.1f}" cy="{y:g}" r="4.5"/>')
    return parts


def _values(figure: Figure) -> list[float]:
    if figure.mean is None or figure.spread is None:
        return [0.0]
    return [figure.mean.mean, figure.spread.largest, figure.mean.high or 0.0]
