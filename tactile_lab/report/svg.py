"""Small vector charts: scales, axes and marks as SVG text, coloured by the page's style sheet.

Marks carry class names, so that the same picture suits the light and the dark page; numbers have a
fixed number of digits, so that equal data give equal text.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from drivers.core.contacts import Array

LEAST_SPAN = 20.0
"""Minimum extent of a map (millimetres)."""


@dataclass(frozen=True)
class Scale:
    """A straight map from values to pixels."""

    low: float
    high: float
    start_px: float
    end_px: float

    def __call__(self, value: float) -> float:
        return self.start_px + (value - self.low) / (self.high - self.low) * (self.end_px - self.start_px)

    def ticks(self, wanted: int = 5) -> list[float]:
        """Round values (steps of 1, 2, 2.5 or 5) inside the scale, about as many as wanted."""
        span = self.high - self.low
        power = 10.0 ** math.floor(math.log10(span / wanted))
        step = min((power * round_step for round_step in (1, 2, 2.5, 5, 10)), key=lambda s: abs(span / s - wanted))
        first, last = math.ceil(self.low / step - 1e-9), math.floor(self.high / step + 1e-9)
        return [count * step for count in range(first, last + 1)]


def tick_label(value: float) -> str:
    """A tick value with as few digits as needed and a proper minus sign."""
    return f"{value:.6g}".replace("-", "\u2212") if abs(value) > 1e-12 else "0"


@dataclass(frozen=True)
class Frame:
    """The outer size of a chart and the margins around its data, pixels."""

    width: float
    height: float
    left: float = 48.0
    right: float = 16.0
    top: float = 16.0
    bottom: float = 40.0


class Chart:
    """A chart under construction; ``text`` gives the finished SVG element."""

    def __init__(self, frame: Frame, x: tuple[float, float], y: tuple[float, float]) -> None:
        self.frame = frame
        self.x = Scale(*x, frame.left, frame.width - frame.right)
        self.y = Scale(*y, frame.height - frame.bottom, frame.top)
        self._elements: list[str] = []

    @classmethod
    def map(cls, width: float, points: Array, margin: float = 0.08, ratios: tuple[float, float] = (0.6, 0.8)) -> Chart:
        """A chart with equal scales on both axes that shows all points of shape (n, 2).

        The height of the data area follows the data, within ``ratios`` of its width.
        """
        low, high = points.min(axis=0), points.max(axis=0)
        centre, span = (low + high) / 2, np.maximum(high - low, LEAST_SPAN) * (1 + 2 * margin)
        frame = Frame(width, width)
        inner = width - frame.left - frame.right
        height = inner * float(np.clip(span[1] / span[0], *ratios))
        half = np.array([inner, height]) * max(span[0] / inner, span[1] / height) / 2
        (left, bottom), (right, top) = centre - half, centre + half
        return cls(Frame(width, height + frame.top + frame.bottom), (left, right), (bottom, top))

    def add(self, element: str) -> None:
        """Add a finished SVG element."""
        self._elements.append(element)

    def axes(self, x_label: str, y_label: str, x_ticks: Sequence[float] | None = None, wanted_y: int = 5) -> None:
        """Grid lines, tick labels and axis titles."""
        frame, base = self.frame, self.frame.height - self.frame.bottom
        for value in self.x.ticks(6) if x_ticks is None else x_ticks:
            self.add(_line(self.x(value), frame.top, self.x(value), base, "grid"))
            self.add(_text(self.x(value), base + 16, tick_label(value), "tick", "middle"))
        for value in self.y.ticks(wanted_y):
            self.add(_line(frame.left, self.y(value), frame.width - frame.right, self.y(value), "grid"))
            self.add(_text(frame.left - 7, self.y(value) + 3.5, tick_label(value), "tick", "end"))
        self.add(_text((frame.left + frame.width - frame.right) / 2, frame.height - 6, x_label, "axis", "middle"))
        middle = (frame.top + base) / 2
        label = _text(12, middle, y_label, "axis", "middle")
        self.add(f'<g transform="rotate(-90 12 {middle:.1f})">{label}</g>')

    def path(self, points: Array, kind: str, *, closed: bool = False, style: str = "") -> None:
        """A line through points of shape (n, 2)."""
        self.add(f'<path class="{kind}" d="{self.trace(points, closed)}"{_style(style)}/>')

    def area(self, rings: Sequence[Array], kind: str) -> None:
        """The area between closed rings (even-odd rule)."""
        trace = "".join(self.trace(ring, closed=True) for ring in rings)
        self.add(f'<path class="{kind}" fill-rule="evenodd" d="{trace}"/>')

    def dot(
        self, at: Sequence[float] | Array, kind: str, *, radius: float = 3.5, tip: str = "", style: str = ""
    ) -> None:
        """A dot at (x, y) with a tooltip."""
        title = f"<title>{escape(tip)}</title>" if tip else ""
        place = f'cx="{self.x(at[0]):.2f}" cy="{self.y(at[1]):.2f}" r="{radius:g}"'
        self.add(f'<circle class="{kind}" {place}{_style(style)}>{title}</circle>')

    def segment(self, start: Array, end: Array, kind: str, style: str = "") -> None:
        """A straight line between two points of shape (2,)."""
        self.add(_line(self.x(start[0]), self.y(start[1]), self.x(end[0]), self.y(end[1]), kind, style))

    def box(
        self, low: tuple[float, float], high: tuple[float, float], kind: str, tip: str = "", style: str = ""
    ) -> None:
        """A rectangle between two corners in data units."""
        x, y, right, bottom = self.x(low[0]), self.y(high[1]), self.x(high[0]), self.y(low[1])
        place = f'x="{x:.2f}" y="{y:.2f}" width="{right - x:.2f}" height="{bottom - y:.2f}" rx="2"'
        self.add(f'<rect class="{kind}" {place}{_style(style)}><title>{escape(tip)}</title></rect>')

    def label(
        self, x: float, y: float, text: str, kind: str = "note", anchor: str = "start", dx: float = 0.0, dy: float = 0.0
    ) -> None:
        """A short text at a place in data units, moved by some pixels."""
        self.add(_text(self.x(x) + dx, self.y(y) + dy, text, kind, anchor))

    def trace(self, points: Array, closed: bool = False) -> str:
        """Points of shape (n, 2) as SVG path data."""
        steps = [f"{self.x(x):.2f} {self.y(y):.2f}" for x, y in points]
        return f"M{'L'.join(steps)}{'Z' if closed else ''}" if steps else ""

    def text(self, title: str, description: str) -> str:
        """The SVG element, with a name and a description for screen readers."""
        size = f'viewBox="0 0 {self.frame.width:.0f} {self.frame.height:.0f}"'
        names = f"<title>{escape(title)}</title><desc>{escape(description)}</desc>"
        label = escape(f"{title}. {description}")
        return f'<svg {size} role="img" aria-label="{label}">{names}{"".join(self._elements)}</svg>'


def _line(x1: float, y1: float, x2: float, y2: float, kind: str, style: str = "") -> str:
    return f'<line class="{kind}" x1="{x1:.2f}" y1="{y1:.2f}" x2="{x2:.2f}" y2="{y2:.2f}"{_style(style)}/>'


def _text(x: float, y: float, text: str, kind: str, anchor: str) -> str:
    return f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'


def _style(style: str) -> str:
    return f' style="{style}"' if style else ""
