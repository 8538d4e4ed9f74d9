"""Outlines over each other as one small picture, for notebooks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from html import escape

import numpy as np

from drivers.core.contacts import Array

_COLOURS = ("#1f77b4", "#d95f02", "#1b9e77", "#7570b3", "#e7298a", "#666666")
_SIZE_px, _MARGIN_px, _LINE_px = 360, 20, 18


@dataclass(frozen=True)
class OutlinePicture:
    """A picture that notebooks show: closed outlines at one scale, each with its name.

    Attributes:
        outlines_m: points of each outline in a common frame, shape (n, 2) or (n, 3), metres, by name.
    """

    outlines_m: Mapping[str, Array]

    def _repr_svg_(self) -> str:
        points = np.concatenate([outline[:, :2] for outline in self.outlines_m.values()])
        low, high = points.min(axis=0), points.max(axis=0)
        scale = (_SIZE_px - 2 * _MARGIN_px) / float(max(*(high - low), 1e-3))
        height = _SIZE_px + _LINE_px * len(self.outlines_m)
        body = "".join(
            _outline((outline[:, :2] - low) * scale + _MARGIN_px, name, index)
            for index, (name, outline) in enumerate(self.outlines_m.items())
        )
        return f'<svg xmlns="http://www.w3.org/2000/svg" width="{_SIZE_px}" height="{height}">{body}</svg>'


def _outline(points_px: Array, name: str, index: int) -> str:
    colour, line_px = _COLOURS[index % len(_COLOURS)], _SIZE_px + _LINE_px * index
    path = " ".join(f"{x:.1f},{_SIZE_px - y:.1f}" for x, y in points_px)
    label = f'<text x="{_MARGIN_px}" y="{line_px}" fill="{colour}" font-family="sans-serif">{escape(name)}</text>'
    return f'<polygon points="{path}" fill="none" stroke="{colour}" stroke-width="2"/>{label}'
