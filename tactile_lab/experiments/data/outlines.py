"""Outlines of the planar objects, and their intersections with straight lines."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from drivers.core.contacts import Array

_CURVE_POINTS = 240  # chord error below 5 micrometres, 1.5 degrees a side


def _arc(centre_x_m: float, semi_axes_m: tuple[float, float], first_deg: float, last_deg: float, count: int) -> Array:
    angles = np.deg2rad(np.linspace(first_deg, last_deg, count, endpoint=False))
    return np.column_stack([centre_x_m + semi_axes_m[0] * np.cos(angles), semi_axes_m[1] * np.sin(angles)])


def _stadium(straight_m: float, radius_m: float) -> Array:
    half, count = straight_m / 2, _CURVE_POINTS // 2
    ends = ((half, -90.0), (-half, 90.0))
    arcs = [_arc(x, (radius_m, radius_m), first, first + 180 + 180 / count, count + 1) for x, first in ends]
    return np.vstack(arcs)


def _mm(*corners: tuple[float, float]) -> Array:
    return np.array(corners) / 1000


OUTLINES_m: Mapping[str, Array] = {
    "rectangle": _mm((-50, -30), (50, -30), (50, 30), (-50, 30)),
    "square": _mm((-35, -35), (35, -35), (35, 35), (-35, 35)),
    "triangle": _mm((-50, -26.7), (50, -26.7), (0, 53.3)),
    "ellipse": _arc(0.0, (0.050, 0.030), 0, 360, _CURVE_POINTS),
    "L": _mm((-40, -32), (60, -32), (60, 8), (0, 8), (0, 48), (-40, 48)),
    "hexagon": _mm((-50, -20), (-10, -38), (45, -25), (50, 10), (10, 38), (-38, 28)),
    "trapezoid": _mm((-50, -28), (50, -28), (28, 30), (-22, 30)),
    "pentagon": _mm((-45, -34), (45, -34), (45, 12), (0, 46), (-45, 12)),
    "stadium": _stadium(0.048, 0.028),
}
"""Outlines in the object's own coordinates, metres, counter-clockwise, first point not repeated.

The square is the only regular polygon: a rotation by an angle of its symmetry cannot be tracked.
"""


def first_crossing(
    outline_m: Array, start_m: Array, way: Array, longest_m: float = np.inf
) -> tuple[Array, Array] | None:
    """The first intersection of a ray with a closed outline, and the outward normal there; None if there is none.

    Args:
        outline_m: counter-clockwise polygon, shape (n, 2).
        start_m, way: start and unit direction, each of shape (2,).
        longest_m: length of the ray.
    """
    edges = np.roll(outline_m, -1, axis=0) - outline_m
    gap = outline_m - start_m
    with np.errstate(divide="ignore", invalid="ignore"):
        across = way[0] * edges[:, 1] - way[1] * edges[:, 0]
        along_ray = (gap[:, 0] * edges[:, 1] - gap[:, 1] * edges[:, 0]) / across
        along_edge = (gap[:, 0] * way[1] - gap[:, 1] * way[0]) / across
    valid = (along_ray > 0) & (along_ray < longest_m) & (along_edge >= 0) & (along_edge <= 1)
    if not valid.any():
        return None
    edge = int(np.where(valid, along_ray, np.inf).argmin())
    return start_m + along_ray[edge] * way, edge_normals(outline_m)[edge]


def edge_normals(outline_m: Array) -> Array:
    """Outward unit normals of a counter-clockwise polygon's sides, shape (n, 2)."""
    edges = np.roll(outline_m, -1, axis=0) - outline_m
    return np.asarray(np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1, keepdims=True))


def random_boundary_points(outline_m: Array, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Random points, uniform over a polygon's boundary, and the outward normals there, each (count, 2)."""
    edges = np.roll(outline_m, -1, axis=0) - outline_m
    lengths = np.linalg.norm(edges, axis=1)
    chosen = rng.choice(len(edges), count, p=lengths / lengths.sum())
    return outline_m[chosen] + rng.random((count, 1)) * edges[chosen], edge_normals(outline_m)[chosen]
