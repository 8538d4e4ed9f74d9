"""The outer size of an estimated shape with its uncertainty, as somebody with a caliper would measure it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.evaluation.estimate_with_truth import EstimateWithTruth, true_outline
from tactile_lab.evaluation.files.mesh_io import read_estimated_mesh
from tactile_lab.evaluation.files.tables import read_contour
from tactile_lab.slam.doubt.sizes import SIDES, sizes


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
    true_mm = [None] * points_m.shape[1] if truth_m is None else [1e3 * size for size, _ in sizes(truth_m)]
    return tuple(
        Extent(name, 1e3 * size, 1e3 * sigma, true)
        for name, (size, sigma), true in zip(SIDES, sizes(points_m, sigma_m), true_mm, strict=False)
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
