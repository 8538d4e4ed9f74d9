"""Corners of a black square from its edges, to a few hundredths of a pixel.

OpenCV's corner refinement looks for the point all gradients around are orthogonal to. On the convex corner of a blurred
square this point lies inside the true corner (a quarter pixel on each axis at the rig's resolution), so that squares
look too small. Blur does not move a straight edge, so here lines are laid through the edges and cut with each other.
"""

from __future__ import annotations

import cv2
import numpy as np

from drivers.camera.frames import Image
from tactile_lab.geometry.contacts import Array

_ALONG = np.linspace(0.12, 0.88, 28)  # shares of a side where its edge is looked for; blur rounds the ends
_STEPS = 25  # samples across the edge
_REACH_MODULES, _MODULES = 0.42, 6.0  # how far across, in modules: less than half of the black border and the white one
_LARGEST_REACH_px, _SMALLEST_REACH_px = 4.0, 1.5


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
    lines = [_line((middles + offsets[..., None] * outward[:, None])[side][found[side]]) for side in range(4)]
    return np.array([_crossing(lines[side - 1], lines[side]) for side in range(4)])


def _edge_offsets(image: Image, middles: Array, outward: Array, reach: float) -> tuple[Array, Array]:
    """Where along the outward normal the grey level rises, (4, n), and whether it clearly does, (4, n).

    The centroid of the rise: blur spreads it evenly to both sides.
    """
    across = np.linspace(-reach, reach, _STEPS)
    points = middles[:, :, None] + across[:, None] * outward[:, None, None]
    maps = points.reshape(4 * len(_ALONG), _STEPS, 2).astype(np.float32)
    levels = cv2.remap(image, maps[..., 0], maps[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    rise = np.maximum(np.diff(np.asarray(levels, float).reshape(4, len(_ALONG), _STEPS), axis=2), 0.0)
    total = rise.sum(axis=2)
    between = (across[1:] + across[:-1]) / 2
    return rise @ between / np.maximum(total, 1e-9), total > 0.5 * np.median(total)


def _line(points: Array) -> tuple[Array, Array]:
    """Point and direction of the line nearest to points (n, 2); outliers beyond three times the median are left out."""
    for _ in range(2):
        middle = points.mean(axis=0)
        direction = np.linalg.svd(points - middle, full_matrices=False)[2][0]
        away = np.abs((points - middle) @ [direction[1], -direction[0]])
        points = points[away <= max(3.0 * float(np.median(away)), 0.05)]
    return middle, direction


def _crossing(one: tuple[Array, Array], two: tuple[Array, Array]) -> Array:
    (p, u), (q, v) = one, two
    along = np.linalg.solve(np.stack([u, -v], axis=1), q - p)
    return np.asarray(p + along[0] * u)
