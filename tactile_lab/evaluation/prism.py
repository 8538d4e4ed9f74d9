"""A contour extruded to a prism: the solid of a planar session."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError

Triangles = NDArray[np.int64]


SAME_POINT_m = 1e-6
"""Mesh readers merge points this close, which would open the walls between them."""


def open_ring(points_m: Array) -> Array:
    """The contour's points, counter-clockwise, without the repeated first point and duplicates.

    Raises:
        ShapeError: fewer than three different points.
    """
    points = np.asarray(points_m, dtype=float)
    keep = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1) > SAME_POINT_m
    ring: Array = points[keep]
    if len(ring) < 3:
        raise ShapeError("contour has fewer than three different points", hint="The session needs more contacts")
    return ring if signed_area_m2(ring) > 0 else ring[::-1]


def signed_area_m2(ring_m: Array) -> float:
    """Area inside a ring of points, positive when it runs counter-clockwise (shoelace formula)."""
    x, y = ring_m.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def prism(ring_m: Array, bottom_m: float, top_m: float) -> tuple[Array, Triangles]:
    """The closed solid between two heights above a counter-clockwise ring.

    Args:
        ring_m: points once each, shape (n, 2), as :func:`open_ring` gives them.
        bottom_m: lower height.
        top_m: upper height.

    Returns:
        Vertices (2n, 3), the lower ring first, and outward facing triangles (4n - 4, 3).
    """
    count = len(ring_m)
    heights = np.repeat([bottom_m, top_m], count)
    vertices = np.column_stack([np.tile(ring_m, (2, 1)), heights])
    lid = triangulate(ring_m)
    here, there = np.arange(count), np.roll(np.arange(count), -1)
    walls = np.concatenate([np.c_[here, there, there + count], np.c_[here, there + count, here + count]])
    return vertices, np.concatenate([lid[:, ::-1], lid + count, walls])


def triangulate(ring_m: Array) -> Triangles:
    """Triangles (n - 2, 3) that fill a counter-clockwise ring, by ear clipping.

    A ring that crosses itself has no proper filling; it still gets a closed set of triangles, because the sharpest
    convex corner is clipped if no ear is left.
    """
    left, triangles = list(range(len(ring_m))), []
    while len(left) > 3:
        ear = _best_ear(ring_m, np.array(left))
        triangles.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear]
    return np.array([*triangles, tuple(left)], dtype=np.int64)


def _best_ear(ring_m: Array, left: Triangles) -> int:
    """Position in ``left`` of the fattest corner whose triangle holds no other corner."""
    points = ring_m[left]
    before, after = np.roll(points, 1, axis=0), np.roll(points, -1, axis=0)
    fatness = _cross(points - before, after - before) / np.sum((after - before) ** 2, axis=1).clip(1e-18)
    order = np.argsort(-fatness, kind="stable")
    reflex = points[fatness < 0]
    for corner in order[fatness[order] > 0]:
        if not _holds_any(before[corner], points[corner], after[corner], reflex):
            return int(corner)
    return int(order[0])


def _holds_any(first: Array, second: Array, third: Array, points: Array) -> bool:
    """Whether a counter-clockwise triangle holds one of the points other than its own corners."""
    sides = [_cross(end - start, points - start) for start, end in ((first, second), (second, third), (third, first))]
    inside = np.all(np.array(sides) >= 0.0, axis=0)
    own = np.any([np.all(points == corner, axis=1) for corner in (first, second, third)], axis=0)
    return bool(np.any(inside & ~own))


def _cross(first: Array, second: Array) -> Array:
    return np.asarray(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])
