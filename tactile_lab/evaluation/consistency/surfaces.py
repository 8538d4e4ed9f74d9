"""Whether a surface's standard deviations are true: how much of it has an error within a multiple of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from gtsam import Pose2, Pose3
from numpy.typing import NDArray
from scipy.special import ndtri

from drivers.core.contacts import Array
from drivers.core.poses import spatial, transform_points
from tactile_lab.evaluation.consistency.levels import CURVE, LEVELS
from tactile_lab.slam.shape.surfaces.sampling import (
    TriangleMesh,
    distances_to_mesh,
    distances_to_polygon,
    mesh_arrays,
    sample_mesh_with_values,
    sample_polygon_with_values,
)

_LEAST_SIGMA_m = 1e-6
_STEP_m, _SAMPLES = 0.0005, 20_000


@dataclass(frozen=True)
class SurfaceConsistency:
    """Stated surface uncertainty against the truth, over the surface's length or area.

    Attributes:
        inside: share of the surface with an error inside the stated interval, for each of
            :data:`~tactile_lab.evaluation.consistency.levels.LEVELS`.
        curve: the same for each of :data:`~tactile_lab.evaluation.consistency.levels.CURVE`.
        log_score: mean log density of the error in metres; of two statements about the same surface the one with the
            higher score was better.
        signed_mm: mean signed error, positive where the estimate is outside the truth.
    """

    inside: tuple[float, ...]
    curve: tuple[float, ...]
    log_score: float
    signed_mm: float


def surface_consistency(signed_m: Array, sigma_m: Array) -> SurfaceConsistency:
    """Judge standard deviations at samples that are spread evenly over a surface.

    Args:
        signed_m: signed error along the normal at each sample, positive outside the truth, shape (n,).
        sigma_m: stated standard deviation there, shape (n,).
    """
    sigma_m = np.maximum(sigma_m, _LEAST_SIGMA_m)
    ratio = np.abs(signed_m) / sigma_m
    log_density = -0.5 * ratio**2 - np.log(sigma_m * np.sqrt(2 * np.pi))

    def inside(levels: Sequence[float]) -> tuple[float, ...]:
        return tuple(float(np.mean(ratio <= ndtri((1 + level) / 2))) for level in levels)

    return SurfaceConsistency(inside(LEVELS), inside(CURVE), float(log_density.mean()), 1e3 * float(signed_m.mean()))


def outline_consistency(points_m: Array, sigma_m: Array, truth_m: Array, truth_T_estimate: Pose2) -> SurfaceConsistency:
    """Judge a closed outline, shape (n, 2), with its standard deviations, shape (n,), by the true one, shape (m, 2)."""
    samples_m, stated_m = sample_polygon_with_values(points_m, sigma_m, _STEP_m)
    moved = transform_points(spatial(truth_T_estimate), np.pad(samples_m, ((0, 0), (0, 1))))[:, :2]
    outside = np.where(_inside_polygon(moved, truth_m), -1.0, 1.0)
    return surface_consistency(outside * distances_to_polygon(moved, truth_m), stated_m)


def mesh_consistency(
    mesh: TriangleMesh, sigma_m: Array, truth: TriangleMesh, truth_T_estimate: Pose3
) -> SurfaceConsistency:
    """Judge a mesh with a standard deviation at each vertex, shape (n,), by the true one."""
    import igl  # here, so that importing this module stays quick

    samples_m, stated_m = sample_mesh_with_values(mesh, sigma_m, _SAMPLES)
    moved = np.ascontiguousarray(transform_points(truth_T_estimate, samples_m))
    within = np.asarray(igl.fast_winding_number(*mesh_arrays(truth), moved)) > 0.5
    return surface_consistency(np.where(within, -1.0, 1.0) * distances_to_mesh(moved, truth), stated_m)


def _inside_polygon(points_m: Array, polygon_m: Array) -> NDArray[np.bool_]:
    """Whether points of shape (q, 2) are inside a closed polygon of shape (n, 2): a ray crosses it an odd number of
    times.
    """
    (x, y), following = points_m.T[:, :, None], np.roll(polygon_m, -1, axis=0)
    (begin_x, begin_y), (end_x, end_y) = polygon_m.T, following.T
    spans = (begin_y > y) != (end_y > y)
    rise = np.where(spans, end_y - begin_y, 1.0)
    crossed = spans & (x < begin_x + (y - begin_y) / rise * (end_x - begin_x))
    return np.asarray(crossed.sum(axis=1) % 2 == 1)
