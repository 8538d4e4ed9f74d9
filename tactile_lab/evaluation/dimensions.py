"""The outer size of an estimated shape with its uncertainty, as somebody with a caliper would measure it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.evaluation.estimate_with_truth import EstimateWithTruth, true_outline
from tactile_lab.evaluation.files.mesh_io import read_estimated_mesh
from tactile_lab.evaluation.files.tables import read_contour
from tactile_lab.slam.doubt.sizes import SIDES, Size, sizes


@dataclass(frozen=True)
class Extent:
    """One outer dimension, millimetres.

    Attributes:
        name: length and width are the sides of the smallest rectangle around the shape seen from above.
        mm: estimated, of the whole shape.
        sigma_mm: its standard deviation. An end that was touched anywhere is as certain as there, whatever its rim is.
        touched_mm, touched_sigma_mm: between the outermost places that were touched; None if nothing was.
        is_guess: whether an end was touched nowhere: then only the touched span is known.
        true_mm: that of the true shape, None if it is unknown.
    """

    name: str
    mm: float
    sigma_mm: float
    touched_mm: float | None
    touched_sigma_mm: float | None
    is_guess: bool
    true_mm: float | None = None


def dimensions(estimate: EstimateWithTruth) -> tuple[Extent, ...] | None:
    """Length, width and, in space, height of the estimated shape; None without one."""
    found = _estimated(estimate)
    if found is None:
        return None
    truth_m = _true_points(estimate)
    true_mm = [None] * len(SIDES) if truth_m is None else [1e3 * size.whole.length_m for size in sizes(truth_m)]
    stated = sizes(*found, estimate.placed_contacts_m)
    return tuple(_extent(name, size, true) for name, size, true in zip(SIDES, stated, true_mm, strict=False))


def _extent(name: str, size: Size, true_mm: float | None) -> Extent:
    whole, touched = size.whole, size.touched
    return Extent(
        name,
        mm=1e3 * whole.length_m,
        sigma_mm=1e3 * whole.sigma_m,
        touched_mm=None if touched is None else 1e3 * touched.length_m,
        touched_sigma_mm=None if touched is None else 1e3 * touched.sigma_m,
        is_guess=size.is_guess,
        true_mm=true_mm,
    )


def _estimated(estimate: EstimateWithTruth) -> tuple[Array, Array, NDArray[np.bool_]] | None:
    """Points of the estimated shape, shape (n, d), their standard deviations, and which were touched."""
    path = estimate.folder / ("contour.csv" if estimate.results.dimension == 2 else "mesh.ply")
    if not path.is_file():
        return None
    if estimate.results.dimension == 2:
        outline = read_contour(path)
        return (outline.points_m, outline.sigma_m, outline.known) if len(outline.sigma_m) else None
    try:
        found = read_estimated_mesh(path)
    except ShapeError:  # the evaluation's warnings say why
        return None
    return np.asarray(found.mesh.vertices, dtype=float), found.sigma_m, found.known


def _true_points(estimate: EstimateWithTruth) -> Array | None:
    if estimate.results.dimension == 2:
        return true_outline(estimate.results, estimate.truth)
    return None if estimate.truth.mesh is None else np.asarray(estimate.truth.mesh.vertices, dtype=float)
