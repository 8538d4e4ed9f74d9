"""The sheet with the charts: title, legend, rows of charts, explanation of marks; and the look of each line."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

from tactile_lab.report.svg import Chart

LETTER_px = 7.2
"""Approximate width of a letter, pixels."""
EARLIER = " *"
"""Suffix to the name of a line that an earlier version of the program made."""
_GAP, _TITLE_HEIGHT, _LEGEND_HEIGHT, _PANEL_TITLE, _KEY_HEIGHT = 18.0, 30.0, 24.0, 20.0, 20.0
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
    "information": 0,
    "random": 6,
    "particle, no graph": 3,
    "known poses": 6,
    "as in the thesis": 1,
}
"""Names that have the same colour in every plot; other names get the remaining colours."""
_MARKS = (
    "M-4 0A4 4 0 1 0 4 0A4 4 0 1 0 -4 0Z",
    "M-3.6-3.6H3.6V3.6H-3.6Z",
    "M0-4.8L4.4 3.2H-4.4Z",
    "M0-5L5 0L0 5L-5 0Z",
)
_DASHES = ("", "7 3", "2 3", "9 3 2 3")

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
.asked { stroke:var(--ink); stroke-width:1.4; stroke-dasharray:5 4; }
line.reach { stroke-width:1.2; opacity:.6; } line.p90 { stroke-width:6; opacity:.38; }
.dot { stroke:var(--page); stroke-width:1.2; }
"""


class Look:
    """Colour, mark and dashes of each line, by its name.

    Args:
        names: names of all lines, in the order of the legend; duplicates are ignored.
        distinct: whether names without a fixed colour get different colours; otherwise all get the same.
    """

    def __init__(self, names: Iterable[str], *, distinct: bool = True) -> None:
        self.names = list(dict.fromkeys(names))
        self._distinct = distinct

    def colour(self, name: str) -> str:
        """As CSS."""
        plain = [other.removesuffix(EARLIER) for other in self.names]
        taken = {_COLOURS[other] for other in plain if other in _COLOURS}
        left = [index for index in range(7) if index not in taken] or [6]
        others, own = [other for other in plain if other not in _COLOURS], name.removesuffix(EARLIER)
        left = left if self._distinct else left[:1]
        return f"var(--s{_COLOURS[own] if own in _COLOURS else left[others.index(own) % len(left)]})"

    def dash(self, name: str) -> str:
        """As an attribute of an SVG path; "" for a solid line."""
        dash = _DASHES[self.names.index(name) % len(_DASHES)]
        return f' stroke-dasharray="{dash}"' if dash else ""

    def mark(self, x: float, y: float, name: str, tip: str = "") -> str:
        """The mark at a position in pixels, with a text that appears under the pointer."""
        shape, title = _MARKS[self.names.index(name) % len(_MARKS)], f"<title>{escape(tip)}</title>"
        place = f'transform="translate({x:.2f} {y:.2f})" style="fill:{self.colour(name)}"'
        return f'<path class="dot" {place} d="{shape}">{title}</path>'


@dataclass(frozen=True)
class Sheet:
    """A sheet of charts.

    Attributes:
        title: title of the sheet.
        width: width in pixels.
        columns: number of charts in a row.
        titles: one per chart.
    """

    title: str
    width: float
    columns: int
    titles: Sequence[str]

    @property
    def panel_width(self) -> float:
        """Width of a chart in pixels."""
        return (self.width - _GAP * (self.columns + 1)) / self.columns

    def svg(self, charts: Sequence[Chart], key: str, legend: Look | None = None) -> str:
        """All charts row by row, between the legend and the explanation of marks."""
        places = self._legend_places(legend.names) if legend else []
        parts = [f'<text class="title" x="{_GAP}" y="22">{escape(self.title)}</text>']
        parts += [_entry(legend, name, *place) for name, place in places] if legend else []
        top = _TITLE_HEIGHT + (places[-1][1][1] + 1) * _LEGEND_HEIGHT if places else _TITLE_HEIGHT + 6.0
        named = list(zip(charts, self.titles, strict=True))
        for first in range(0, len(charts), self.columns):
            row = named[first : first + self.columns]
            parts += [self._panel(column, top, *one) for column, one in enumerate(row)]
            top += _PANEL_TITLE + max(chart.frame.height for chart, _ in row) + _GAP
        parts.append(f'<text x="{_GAP:.0f}" y="{top:.0f}">{escape(key)}</text>')
        return self._file("".join(parts), top + _KEY_HEIGHT)

    def _file(self, inside: str, height: float) -> str:
        width = f"{self.width:.0f}"
        size = f'viewBox="0 0 {width} {height:.0f}" width="{width}" height="{height:.0f}"'
        page = f'<rect class="page" width="{width}" height="{height:.0f}"/>'
        return f'<svg xmlns="http://www.w3.org/2000/svg" {size}><style>{STYLE}</style>{page}{inside}</svg>\n'

    def _panel(self, column: int, top: float, chart: Chart, title: str) -> str:
        left, frame = _GAP + column * (self.panel_width + _GAP), chart.frame
        name = f'<text class="panel" x="{left:.0f}" y="{top + 14:.0f}">{escape(title)}</text>'
        size = f'x="{left:.1f}" y="{top + _PANEL_TITLE:.1f}" width="{frame.width:.1f}" height="{frame.height:.1f}"'
        return name + chart.text(title, "").replace("<svg ", f"<svg {size} ", 1)

    def _legend_places(self, names: list[str]) -> list[tuple[str, tuple[float, int]]]:
        """Each name with its left edge and line."""
        places: list[tuple[str, tuple[float, int]]] = []
        left, line = _GAP, 0
        for name in names:
            width = 40.0 + LETTER_px * len(name)
            if left + width > self.width - _GAP and left > _GAP:
                left, line = _GAP, line + 1
            places.append((name, (left, line)))
            left += width
        return places


def _entry(legend: Look, name: str, left: float, line: int) -> str:
    """A name in the legend, with a sample of its line."""
    y = _TITLE_HEIGHT + 12 + line * _LEGEND_HEIGHT
    piece = f'<path class="line" stroke="{legend.colour(name)}"{legend.dash(name)} d="M{left:.0f} {y - 4:.0f}h24"/>'
    text = f'<text class="name" x="{left + 30:.0f}" y="{y:.0f}">{escape(name)}</text>'
    return piece + legend.mark(left + 12, y - 4, name) + text
