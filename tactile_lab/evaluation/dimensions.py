"""The outer size of an estimated shape with its uncertainty, as somebody with a caliper would measure it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.evaluation.estimate_with_truth import EstimateWithTruth, true_outline
from tactile_lab.evaluation.files.mesh_io import read_estimated_mesh
from tactile_lab.evaluation.files.tables import read_contour

_JAW_m = 0.0005
"""Points this close to the outermost one touch a caliper's jaw too; their standard deviations are averaged."""


@dataclass(frozen=True)
class Extent:
    """One outer dimension, millimetres.

    Attributes:
        name: length and width are the sides of the smallest rectangle around the shape seen from above.
        mm: estimated.
        sigma_mm: its standard deviation, those of both sides being independent.
        true_mm: that of the true shape, None if it is unknown.
    """

    name: str
    mm: float
    sigma_mm: float
    true_mm: float | None = None


def dimensions(estimate: EstimateWithTruth) -> tuple[Extent, ...] | None:
    """Length, width and, in space, height of the estimated shape; None without one."""
    found = _estimated(estimate)
    if found is None:
        return None
    points_m, sigma_m = found
    truth_m = _true_points(estimate)
    true_mm = [None] * points_m.shape[1] if truth_m is None else [1e3 * size for size, _ in _sizes(truth_m)]
    names = ("length", "width", "height")
    return tuple(
        Extent(name, 1e3 * size, 1e3 * sigma, true)
        for name, (size, sigma), true in zip(names, _sizes(points_m, sigma_m), true_mm, strict=False)
    )


def _estimated(estimate: EstimateWithTruth) -> tuple[Array, Array] | None:
    """Points of the estimated shape, shape (n, d), and their standard deviations."""
    path = estimate.folder / ("contour.csv" if estimate.results.dimension == 2 else "mesh.ply")
    if not path.is_file():
        return None
    if estimate.results.dimension == 2:
        outline = read_contour(path)
        return (outline.points_m, outline.sigma_m) if len(outline.sigma_m) else None
    try:
        found = read_estimated_mesh(path)
    except ShapeError:  # the evaluation's warnings say why
        return None
    return np.asarray(found.mesh.vertices, dtype=float), found.sigma_m


def _true_points(estimate: EstimateWithTruth) -> Array | None:
    if estimate.results.dimension == 2:
        return true_outline(estimate.results, estimate.truth)
    return None if estimate.truth.mesh is None else np.asarray(estimate.truth.mesh.vertices, dtype=float)


def _sizes(points_m: Array, sigma_m: Array | None = None) -> Sequence[tuple[float, float]]:
    """Length, width and, of points in space, height, each with its standard deviation, metres."""
    sigma_m = np.zeros(len(points_m)) if sigma_m is None else sigma_m
    along, across = _rectangle(points_m[:, :2])
    places = [points_m[:, :2] @ along, points_m[:, :2] @ across, *points_m[:, 2:].T]
    return [_size(place, sigma_m) for place in places]


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


def _size(places_m: Array, sigma_m: Array) -> tuple[float, float]:
    low, high = float(places_m.min()), float(places_m.max())
    jaws = places_m <= low + _JAW_m, places_m >= high - _JAW_m
    return high - low, float(np.hypot(*(sigma_m[jaw].mean() for jaw in jaws)))
