"""Intersection over union of areas and volumes."""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.shape.surfaces.sampling import TriangleMesh, mesh_arrays, polygon_area

_OVERLAP_SAMPLES = 40_000


def polygon_overlap(first_m: Array, second_m: Array) -> float:
    """Intersection over union of the areas of two closed simple polygons, exact."""
    shared = abs(shared_area(first_m, second_m))
    union = abs(polygon_area(first_m)) + abs(polygon_area(second_m)) - shared
    return shared / union if union > 0 else 0.0


def mesh_overlap(first: TriangleMesh, second: TriangleMesh) -> float:
    """Intersection over union of the volumes of two closed meshes, by winding numbers at evenly spread points."""
    import igl  # here, so that importing this module stays quick

    meshes = [mesh_arrays(mesh) for mesh in (first, second)]
    both = np.vstack([vertices for vertices, _ in meshes])
    points = both.min(axis=0) + np.ptp(both, axis=0) * _evenly_spread(_OVERLAP_SAMPLES)
    inside = [np.asarray(igl.fast_winding_number(*mesh, points)) > 0.5 for mesh in meshes]
    union = np.count_nonzero(inside[0] | inside[1])
    return float(np.count_nonzero(inside[0] & inside[1]) / union) if union else 0.0


def shared_area(first_m: Array, second_m: Array) -> float:
    """Area of the intersection of both polygons, positive if they have the same orientation.

    The inside of a polygon is the sum of the signed strips between its edges and a line below, so that the
    shared area is the signed sum, over all pairs of edges, of the area below both edges.
    """
    floor = np.append(first_m, second_m, axis=0).min(axis=0)
    (begin_a, end_a), (begin_b, end_b) = _edges(first_m - floor), _edges(second_m - floor)
    begin_a, end_a = begin_a[:, :, None], end_a[:, :, None]
    begin_b, end_b = begin_b[:, None, :], end_b[:, None, :]
    left = np.maximum(np.minimum(begin_a[0], end_a[0]), np.minimum(begin_b[0], end_b[0]))
    right = np.minimum(np.maximum(begin_a[0], end_a[0]), np.maximum(begin_b[0], end_b[0]))
    width = np.maximum(right - left, 0.0)
    sums, gaps = [], []
    for x in (left, right):
        height_a, height_b = _height(begin_a, end_a, x), _height(begin_b, end_b, x)
        sums.append(height_a + height_b)
        gaps.append(height_a - height_b)
    signs = np.sign(end_a[0] - begin_a[0]) * np.sign(end_b[0] - begin_b[0])
    return float(np.sum(signs * width * ((sums[0] + sums[1]) / 2 - _mean_magnitude(*gaps)) / 2))


def _edges(polygon_m: Array) -> tuple[Array, Array]:
    """Start and end points of the edges, each of shape (2, n)."""
    return polygon_m.T, np.roll(polygon_m, -1, axis=0).T


def _height(begin: Array, end: Array, x: Array) -> Array:
    run = end[0] - begin[0]
    return np.asarray(
        begin[1] + (x - begin[0]) * np.divide(end[1] - begin[1], run, out=np.zeros_like(run), where=run != 0)
    )


def _mean_magnitude(first: Array, last: Array) -> Array:
    """Mean of ``|y|`` while y goes linearly from ``first`` to ``last``."""
    total = np.abs(first) + np.abs(last)
    crossing = np.divide(first**2 + last**2, total, out=np.zeros_like(total), where=total > 0)
    return np.asarray(np.where(first * last < 0, crossing, total) / 2)


def _evenly_spread(count: int) -> Array:
    """Points of the unit cube, shape (count, 3): a Kronecker sequence on the root of x^4 = x + 1."""
    steps = 1.22074408460575947536 ** -np.arange(1.0, 4.0)
    return np.asarray((0.5 + np.arange(1, count + 1)[:, None] * steps) % 1.0)
