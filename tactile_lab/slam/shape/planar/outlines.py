"""Closed polygons in the plane: self-intersection, inside and outside."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array

_PAIRS_AT_ONCE = 1 << 20


def is_simple(polygon_m: Array) -> bool:
    """Whether no two edges of a closed polygon of shape (n, 2) cross or touch, except neighbours at their corner."""
    starts, ends = polygon_m, np.roll(polygon_m, -1, axis=0)
    count = len(starts)
    first, second = np.triu_indices(count, k=2)
    apart = (first != 0) | (second != count - 1)
    first, second = first[apart], second[apart]
    if _cross(starts[first], ends[first], starts[second], ends[second]).any():
        return False
    forth, back = ends - starts, np.roll(starts - ends, 1, axis=0)
    folded = np.abs(_wedge(forth, back)) <= 1e-12 * np.sum(forth**2, axis=1)
    return not bool((folded & (np.sum(forth * back, axis=1) > 0)).any())


def _cross(a: Array, b: Array, c: Array, d: Array) -> NDArray[np.bool_]:
    """Whether the segments ab and cd have a point in common, row by row."""
    one, two = _wedge(b - a, c - a), _wedge(b - a, d - a)
    three, four = _wedge(d - c, a - c), _wedge(d - c, b - c)
    overlap = np.all(np.minimum(a, b) <= np.maximum(c, d), axis=1) & np.all(
        np.minimum(c, d) <= np.maximum(a, b), axis=1
    )
    return np.asarray((one * two <= 0) & (three * four <= 0) & overlap)


def _wedge(a: Array, b: Array) -> Array:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def encloses(polygon_m: Array, points_m: Array) -> NDArray[np.bool_]:
    """Whether points of shape (q, 2) are inside a closed polygon of shape (n, 2), by the crossings of a ray."""
    size = max(1, _PAIRS_AT_ONCE // len(polygon_m))
    blocks = [_encloses(polygon_m, points_m[i : i + size]) for i in range(0, max(len(points_m), 1), size)]
    return np.concatenate(blocks)


def _encloses(polygon_m: Array, points_m: Array) -> NDArray[np.bool_]:
    (x, y), (next_x, next_y) = polygon_m.T, np.roll(polygon_m, -1, axis=0).T
    above, next_above = y > points_m[:, 1:], next_y > points_m[:, 1:]
    rise = np.where(next_y == y, 1.0, next_y - y)
    crossing_x = x + (points_m[:, 1:] - y) / rise * (next_x - x)
    return np.asarray(((above != next_above) & (points_m[:, :1] < crossing_x)).sum(axis=1) % 2 == 1)
