"""Whether a surface's standard deviations are true: how much of it has an error within a multiple of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from gtsam import Pose2, Pose3
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from scipy.special import ndtri

from drivers.core.contacts import Array
from drivers.core.poses import spatial, transform_points
from tactile_lab.evaluation.consistency.levels import CURVE, LEVELS
from tactile_lab.slam.shape.surfaces.sampling import (
    MeshDistances,
    TriangleMesh,
    distances_to_polygon,
    mesh_arrays,
    sample_mesh_with_values,
    sample_polygon_with_values,
)
from tactile_lab.slam.shape.surfaces.surface import RESOLUTION_m

_LEAST_SIGMA_m = 1e-6
_STEP_m, _SAMPLES = 0.0005, 20_000
_FITTED = 1000
"""About so many samples determine the best fit."""

_LEVER_m = 0.05


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
    return surface_consistency(*outline_errors(points_m, sigma_m, truth_m, truth_T_estimate))


def outline_errors(points_m: Array, sigma_m: Array, truth_m: Array, truth_T_estimate: Pose2) -> tuple[Array, Array]:
    """Signed errors of samples spread evenly over an outline, and their standard deviations, each of shape (q,).

    Errors are those left by the rigid motion near the given one for which they are least, each counted by its standard
    deviation: a part that is said to be a guess must not displace the others.
    """
    samples_m, stated_m = sample_polygon_with_values(points_m, sigma_m, _STEP_m)

    def signed_m(places_m: Array) -> Array:
        outside = np.where(_inside_polygon(places_m[:, :2], truth_m), -1.0, 1.0)
        return np.asarray(outside * distances_to_polygon(places_m[:, :2], truth_m))

    moved = transform_points(spatial(truth_T_estimate), np.pad(samples_m, ((0, 0), (0, 1))))
    return signed_m(_settled(moved, stated_m, signed_m, upright=True)), stated_m


def mesh_consistency(
    mesh: TriangleMesh, sigma_m: Array, truth: TriangleMesh, truth_T_estimate: Pose3, *, upright: bool = True
) -> SurfaceConsistency:
    """Judge a mesh with a standard deviation at each vertex, shape (n,), by the true one."""
    return surface_consistency(*mesh_errors(mesh, sigma_m, truth, truth_T_estimate, upright=upright))


def mesh_errors(
    mesh: TriangleMesh, sigma_m: Array, truth: TriangleMesh, truth_T_estimate: Pose3, *, upright: bool = True
) -> tuple[Array, Array]:
    """As :func:`outline_errors`, of a mesh; ``upright`` restricts the motion to one on the table."""
    import igl  # here, so that importing this module stays quick

    samples_m, stated_m = sample_mesh_with_values(mesh, sigma_m, _SAMPLES)
    solid, distances = mesh_arrays(truth), MeshDistances(truth)

    def signed_m(places_m: Array) -> Array:
        places_m = np.ascontiguousarray(places_m)
        within = np.asarray(igl.fast_winding_number(*solid, places_m)) > 0.5
        return np.asarray(np.where(within, -1.0, 1.0) * distances.of(places_m))

    moved = transform_points(truth_T_estimate, samples_m)
    return signed_m(_settled(moved, stated_m, signed_m, upright=upright)), stated_m


def _settled(places_m: Array, sigma_m: Array, signed_m: Callable[[Array], Array], *, upright: bool) -> Array:
    """Places of shape (n, 3) after the small rigid motion that makes their errors least, by what is stated of them."""
    some = slice(None, None, max(1, len(places_m) // _FITTED))
    middle_m, weights = places_m.mean(axis=0), 1 / np.hypot(sigma_m[some], RESOLUTION_m)
    motion = np.eye(6)[[0, 1, 5]] if upright else np.eye(6)

    def moved(given_m: Array, step_m: Array) -> Array:
        shift_m, turn = np.split(step_m @ motion, 2)
        return np.asarray(Rotation.from_rotvec(turn / _LEVER_m).apply(given_m - middle_m) + middle_m + shift_m)

    def weighed(step_m: Array) -> Array:
        return np.asarray(signed_m(moved(places_m[some], step_m)) * weights)

    return moved(places_m, least_squares(weighed, np.zeros(len(motion)), method="lm", xtol=1e-5).x)


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
