"""Few large convex pieces from many small ones: neighbours are merged, as long as their hull stays where it may be."""

from __future__ import annotations

from collections.abc import Iterable
from heapq import heapify, heappop, heappush

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from drivers.core.contacts import Array

_ROUNDING_m = 1e-9
"""A place that lies no deeper than this is on the surface."""


def merge_neighbours(pieces: Iterable[Array], neighbours: NDArray[np.intp], kept_out_m: Array) -> list[Array]:
    """Merge convex pieces with their neighbours, smallest first, into hulls that contain none of the places kept out.

    Args:
        pieces: corners of each, shape (n, 3).
        neighbours: pairs of pieces that touch each other, shape (m, 2).
        kept_out_m: places, shape (k, 3), that no merged hull may contain.

    Returns:
        The corners of each piece that is left, shape (n, 3).
    """
    found, beside = dict(enumerate(pieces)), _beside(neighbours)
    places_m = kept_out_m[np.argsort(kept_out_m[:, 0])]
    queue = [(_extent_m(found[a], found[b]), a, b) for a, b in neighbours.tolist()]
    heapify(queue)
    new = len(found)
    while queue:
        _, a, b = heappop(queue)
        if a not in found or b not in found or (hull := _hull_without(found[a], found[b], places_m)) is None:
            continue
        del found[a], found[b]
        found[new], beside[new] = hull, (beside.pop(a) | beside.pop(b)) - {a, b}
        for other in sorted(beside[new]):
            beside[other] = beside[other] - {a, b} | {new}
            heappush(queue, (_extent_m(hull, found[other]), other, new))
        new += 1
    return list(found.values())


def _beside(neighbours: NDArray[np.intp]) -> dict[int, set[int]]:
    """The neighbours of each piece that has any."""
    beside: dict[int, set[int]] = {}
    for a, b in neighbours.tolist():
        beside.setdefault(a, set()).add(b)
        beside.setdefault(b, set()).add(a)
    return beside


def _extent_m(one: Array, other: Array) -> float:
    """Diagonal of the box around two pieces."""
    high, low = np.maximum(one.max(axis=0), other.max(axis=0)), np.minimum(one.min(axis=0), other.min(axis=0))
    return float(np.linalg.norm(high - low))


def _hull_without(one: Array, other: Array, places_m: Array) -> Array | None:
    """Corners of the hull of two pieces, None if one of some places, sorted by x, is inside it."""
    corners = np.vstack([one, other])
    hull = ConvexHull(corners)
    low, high = corners.min(axis=0), corners.max(axis=0)
    first, last = np.searchsorted(places_m[:, 0], (low[0], high[0]))
    near = places_m[first:last]
    near = near[((near > low) & (near < high)).all(axis=1)]
    above_m = near @ hull.equations[:, :3].T + hull.equations[:, 3]
    return None if (above_m < -_ROUNDING_m).all(axis=1).any() else np.asarray(corners[hull.vertices])
