"""The outer size of a shape with its uncertainty, as somebody with a caliper would measure it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from drivers.core.contacts import Array
from tactile_lab.slam.doubt.status import Doubt
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

SIDES = ("length", "width", "height")
"""The longer and the shorter side of the smallest rectangle around the shape seen from above, and its height."""

LARGEST_SIGMA_m = 0.010
"""Standard deviation of a size of a complete shape."""

_JAW_m = 0.0005
"""Points this close to the outermost one touch a caliper's jaw too; their standard deviations are averaged."""


def unknown_sizes(shape: Contour | SurfaceMesh | None) -> list[Doubt]:
    """A doubt where an end of the shape is a guess: most of a surface may be known, and yet not how long it is.

    An end that was touched anywhere is as certain as there, whatever its rim is.
    """
    if shape is None:
        return []
    points_m = shape.points_m if isinstance(shape, Contour) else shape.vertices
    unknown = [
        f"{name} {1e3 * size:.0f} ± {1e3 * sigma:.0f} mm"
        for name, (size, sigma) in zip(SIDES, sizes(points_m, shape.sigma_m, shape.known), strict=False)
        if sigma > LARGEST_SIGMA_m
    ]
    if not unknown:
        return []
    return [Doubt("unknown-size", f"an end of it was not touched: {', '.join(unknown)}", grave=False)]


def sizes(
    points_m: Array, sigma_m: Array | None = None, known: NDArray[np.bool_] | None = None
) -> Sequence[tuple[float, float]]:
    """Length, width and, of points in space, height, each with its standard deviation, metres.

    Args:
        points_m: of an outline, shape (n, 2), or a surface, shape (n, 3).
        sigma_m: their standard deviations, shape (n,); none by default.
        known: which of them were touched, shape (n,), and count where an end has any; all alike by default.
    """
    sigma_m = np.zeros(len(points_m)) if sigma_m is None else sigma_m
    known = np.ones(len(points_m), dtype=bool) if known is None else known
    along, across = _rectangle(points_m[:, :2])
    places = [points_m[:, :2] @ along, points_m[:, :2] @ across, *points_m[:, 2:].T]
    return [_size(place, sigma_m, known) for place in places]


def _rectangle(points_m: Array) -> tuple[Array, Array]:
    """Directions of the longer and the shorter side of the smallest rectangle around points of shape (n, 2).

    One of its sides lies along a side of their convex hull.
    """
    hull = points_m[ConvexHull(points_m).vertices]
    sides = np.roll(hull, -1, axis=0) - hull
    along = sides / np.linalg.norm(sides, axis=1, keepdims=True)
    across = np.column_stack([-along[:, 1], along[:, 0]])
    spans = np.ptp(hull @ along.T, axis=0), np.ptp(hull @ across.T, axis=0)
    best = int(np.argmin(spans[0] * spans[1]))
    longer_first = spans[0][best] >= spans[1][best]
    return (along[best], across[best]) if longer_first else (across[best], along[best])


def _size(places_m: Array, sigma_m: Array, known: NDArray[np.bool_]) -> tuple[float, float]:
    low, high = float(places_m.min()), float(places_m.max())
    jaws = places_m <= low + _JAW_m, places_m >= high - _JAW_m
    felt = [jaw & known if (jaw & known).any() else jaw for jaw in jaws]
    return high - low, float(np.hypot(*(sigma_m[jaw].mean() for jaw in felt)))
