"""Corners of a black square from its edges, to a few hundredths of a pixel.

OpenCV's corner refinement looks for the point all gradients around are orthogonal to. On the convex corner of a blurred
square this point lies inside the true corner (a quarter pixel on each axis at the rig's resolution), so that squares
look too small. Blur does not move a straight edge, so here lines are laid through the edges and cut with each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from drivers.camera.frames import Image
from tactile_lab.geometry.contacts import Array

_ALONG = np.linspace(0.12, 0.88, 28)  # shares of a side where its edge is looked for; blur rounds the ends
_STEPS = 25  # samples across the edge
_REACH_MODULES, _MODULES = 0.42, 6.0  # how far across, in modules: less than half of the black border and the white one
_LARGEST_REACH_px, _SMALLEST_REACH_px = 4.0, 1.5
_BOWED_px = 90.0
"""Shorter edges bow by less than their noise in the lenses of laboratories (a tenth of barrel distortion)."""


def refine_corners(image: Image, corners_px: Array) -> Array:
    """Corners (4, 2) of a dark square on white, clockwise in the picture, from a guess within about a pixel.

    Two passes: noise draws an edge toward where it was looked for. Returns the guess where an edge can not be found.
    """
    return _pass(image, _pass(image, corners_px))


def _pass(image: Image, corners_px: Array) -> Array:
    following = np.roll(corners_px, -1, axis=0)
    sides = following - corners_px
    lengths = np.linalg.norm(sides, axis=1)
    reach = float(np.clip(_REACH_MODULES * lengths.min() / _MODULES, _SMALLEST_REACH_px, _LARGEST_REACH_px))
    outward = np.stack([sides[:, 1], -sides[:, 0]], axis=1) / lengths[:, None]
    middles = corners_px[:, None] + _ALONG[:, None] * sides[:, None]
    offsets, found = _edge_offsets(image, middles, outward, reach)
    if np.any(found.sum(axis=1) < len(_ALONG) // 2):
        return corners_px
    points = middles + offsets[..., None] * outward[:, None]
    edges = [_edge(points[side][found[side]], float(lengths[side])) for side in range(4)]
    return np.array(
        [
            _crossing(edges[side - 1].tangent(corners_px[side]), edges[side].tangent(corners_px[side]))
            for side in range(4)
        ]
    )


def edge_blur_px(image: Image, corners_px: Array) -> float:
    """How wide the widest edge of a dark square on white is: standard deviation of its blur, pixels.

    From the steepest rise of the mean profile across each side and the square's contrast; of a Gaussian blur the rise
    is contrast / (sigma * sqrt(2 pi)). Motion widens two of the four edges, so that the widest one counts.
    Infinite for a square without contrast.
    """
    sides = np.roll(corners_px, -1, axis=0) - corners_px
    lengths = np.linalg.norm(sides, axis=1)
    reach = float(np.clip(_REACH_MODULES * lengths.min() / _MODULES, _SMALLEST_REACH_px, _LARGEST_REACH_px))
    outward = np.stack([sides[:, 1], -sides[:, 0]], axis=1) / lengths[:, None]
    middles = corners_px[:, None] + _ALONG[:, None] * sides[:, None]
    profiles = _levels(image, middles, outward, np.linspace(-reach, reach, _STEPS)).mean(axis=1)
    steepest = np.diff(profiles, axis=1).max(axis=1) / (2 * reach / (_STEPS - 1))
    return float(np.max(_contrast(image, corners_px) / np.maximum(steepest, 1e-9)) / np.sqrt(2 * np.pi))


def _contrast(image: Image, corners_px: Array) -> float:
    """Grey levels between the dark and the light parts around a square."""
    low = np.maximum(np.floor(corners_px.min(axis=0)).astype(int), 0)
    high = np.ceil(corners_px.max(axis=0)).astype(int) + 1
    patch = image[low[1] : high[1], low[0] : high[0]]
    dark, light = np.percentile(patch, [5, 95]) if patch.size else (0.0, 0.0)
    return float(light - dark) or np.inf


def _edge_offsets(image: Image, middles: Array, outward: Array, reach: float) -> tuple[Array, Array]:
    """Where along the outward normal the grey level rises, (4, n), and whether it clearly does, (4, n).

    The centroid of the rise: blur spreads it evenly to both sides.
    """
    across = np.linspace(-reach, reach, _STEPS)
    rise = np.maximum(np.diff(_levels(image, middles, outward, across), axis=2), 0.0)
    total = rise.sum(axis=2)
    between = (across[1:] + across[:-1]) / 2
    return rise @ between / np.maximum(total, 1e-9), total > 0.5 * np.median(total)


def _levels(image: Image, middles: Array, outward: Array, across: Array) -> Array:
    """Grey levels along lines across the edges, shape (4, places along, places across)."""
    points = middles[:, :, None] + across[:, None] * outward[:, None, None]
    maps = points.reshape(-1, len(across), 2).astype(np.float32)
    levels = cv2.remap(image, maps[..., 0], maps[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(levels, float).reshape(4, -1, len(across))


@dataclass(frozen=True, eq=False)
class _Edge:
    """An edge: a line through ``middle``, and how far it bows to the side of ``across``: c0 + c1 t + c2 t^2."""

    middle: Array
    direction: Array
    bow: Array

    @property
    def across(self) -> Array:
        return np.array([self.direction[1], -self.direction[0]])

    def tangent(self, near_px: Array) -> tuple[Array, Array]:
        """Point and direction of the edge near a point."""
        t = float((near_px - self.middle) @ self.direction)
        aside, slope = np.polyval(self.bow, t), np.polyval(np.polyder(self.bow), t)
        return self.middle + t * self.direction + aside * self.across, self.direction + slope * self.across


def _edge(points: Array, length_px: float) -> _Edge:
    """The edge nearest to points (n, 2), bowed if it is long; points beyond three times the median are left out."""
    for _ in range(2):
        middle = points.mean(axis=0)
        direction = np.linalg.svd(points - middle, full_matrices=False)[2][0]
        along, aside = (points - middle) @ direction, (points - middle) @ [direction[1], -direction[0]]
        bow = np.polyfit(along, aside, 2) if length_px > _BOWED_px else np.zeros(1)
        away = np.abs(aside - np.polyval(bow, along))
        points = points[away <= max(3.0 * float(np.median(away)), 0.05)]
    return _Edge(middle, direction, bow)


def _crossing(one: tuple[Array, Array], two: tuple[Array, Array]) -> Array:
    (p, u), (q, v) = one, two
    along = np.linalg.solve(np.stack([u, -v], axis=1), q - p)
    return np.asarray(p + along[0] * u)
