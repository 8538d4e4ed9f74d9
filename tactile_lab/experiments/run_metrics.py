"""Figures of one run: quality of the shape, the tracking and the stated uncertainty, and computing time.

Shape: Hausdorff and mean distance (appendix C) after the best rigid alignment. Tracking: registration error; rotations
    of an object about its axis of symmetry, which no contact can distinguish, are ignored. Uncertainty: share of the
    surface whose true error is within two stated standard deviations, and shares of surface and poses inside their
    stated 50, 68 and 95 % regions (:mod:`tactile_lab.evaluation.consistency`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import trimesh

from drivers.core.contacts import Array
from drivers.core.poses import spatial, transform_points
from tactile_lab.evaluation.consistency.pose_covariance import covariances_in_world
from tactile_lab.evaluation.consistency.poses import birth_frame, common_frame, pose_consistency
from tactile_lab.evaluation.consistency.surfaces import SurfaceConsistency, mesh_consistency, outline_consistency
from tactile_lab.evaluation.registration import registration_rms_mm
from tactile_lab.evaluation.trajectory import Poses
from tactile_lab.evaluation.truth.rotational_symmetry import (
    ORIGIN_m,
    modulo_symmetry,
    outline_symmetry,
    round_axis_m,
    stands,
    symmetry_turns,
)
from tactile_lab.experiments.data.planar_data import PlanarGrasps
from tactile_lab.experiments.data.sensing import SimulatedGrasps
from tactile_lab.experiments.data.spatial_data import SpatialGrasps
from tactile_lab.slam.doubt.sizes import sizes
from tactile_lab.slam.doubt.symmetry import Symmetry
from tactile_lab.slam.result import SlamResult
from tactile_lab.slam.shape.metrics.alignment import align_contours, align_meshes
from tactile_lab.slam.shape.metrics.metrics import ShapeErrors, contour_errors, mesh_errors
from tactile_lab.slam.shape.surfaces.sampling import distances_to_mesh, distances_to_polygon
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

NO_SIZES: dict[str, list[float]] = {"size_z": [], "size_off_mm": []}
"""Of a result without a shape, or one that does not stand on a table."""

NO_SHAPE: dict[str, Any] = {"hausdorff_mm": None, "mean_mm": None, "iou": None, "within_2_sigma": None}


def contour_figures(contour: Contour | None, outline_m: Array) -> dict[str, Any]:
    """Figures of an estimated outline compared with the true one, shape (n, 2)."""
    if contour is None:
        return dict(NO_SHAPE)
    fit = align_contours(contour.points_m, outline_m)
    moved = transform_points(spatial(fit), np.pad(contour.points_m, ((0, 0), (0, 1))))[:, :2]
    covered = _within(distances_to_polygon(moved, outline_m), contour.sigma_m)
    judged = outline_consistency(contour.points_m, contour.sigma_m, outline_m, fit)
    return _shape_figures(contour_errors(contour.points_m, outline_m, fit), covered, contour.is_closed, judged)


def mesh_figures(mesh: SurfaceMesh | None, truth: trimesh.Trimesh, *, upright: bool = True) -> dict[str, Any]:
    """Figures of an estimated surface compared with the true one; ``upright`` restricts the best fit to rotations about
    the vertical.
    """
    if mesh is None:
        return dict(NO_SHAPE)
    fit = align_meshes(mesh, truth, upright=upright)
    covered = _within(distances_to_mesh(transform_points(fit, mesh.vertices), truth), mesh.sigma_m)
    judged = mesh_consistency(mesh, mesh.sigma_m, truth, fit, upright=upright)
    return _shape_figures(mesh_errors(mesh, truth, fit), covered, mesh.is_closed, judged)


def slam_figures(data: SimulatedGrasps, result: SlamResult) -> dict[str, Any]:
    """Figures of a whole run."""
    if isinstance(data, PlanarGrasps):
        shape = contour_figures(result.contour, data.outline_m)
        ends = size_figures(result.contour, data.outline_m)
    elif isinstance(data, SpatialGrasps):
        upright = all(map(stands, data.world_T_body))
        shape = mesh_figures(result.mesh, data.mesh, upright=upright)
        ends = size_figures(result.mesh if upright else None, np.asarray(data.mesh.vertices))
    return {
        **shape,
        **ends,
        **pose_figures(data, result),
        "registration_mm": registration_mm(data, result.world_T_object, result.dimension),
        "status": result.status,
        "contacts": sum(len(grasp.contacts) for grasp in data.grasps),
        "untracked": sum(step.verdict == "untracked" for step in result.steps),
        "step_ms": [round(1e3 * seconds, 3) for seconds in result.step_seconds[1:]],
    }


def pose_figures(data: SimulatedGrasps, result: SlamResult) -> dict[str, Any]:
    """Stated pose covariances against the truth, in the first grasp's object frame and in the best common one."""
    truth, symmetry = data.world_T_body, _symmetry(data)
    poses, axis_m = _modulo(symmetry, result.world_T_object, truth), round_axis_m(symmetry, truth)
    stated = covariances_in_world(result)
    in_common = covariances_in_world(replace(result, covariances=result.common_covariances or result.covariances))
    figures: dict[str, Any] = {}
    for name, given, frame in (
        ("", stated, birth_frame(poses, truth)),
        ("common_", in_common, common_frame(poses, truth)),
    ):
        judged = pose_consistency(poses, given, truth, frame, axis_m)
        if judged is not None:
            figures |= {
                f"{name}poses_inside": list(judged.inside),
                f"{name}nees": [round(value, 4) for value in judged.nees],
                f"{name}poses_log_score": judged.log_score,
            }
    return figures


def registration_mm(data: SimulatedGrasps, estimate: Poses, dimension: int) -> float | None:
    """Registration error of a trajectory; rotations that no contact can distinguish are ignored."""
    poses = _modulo(_symmetry(data), estimate, data.world_T_body)
    contacts = [grasp.points_world_m for grasp in data.grasps]
    return registration_rms_mm(contacts, poses, data.world_T_body, dimension)


def _modulo(symmetry: Symmetry | None, estimate: Poses, truth: Poses) -> Poses:
    return estimate if symmetry is None else modulo_symmetry(estimate, truth, symmetry.order, symmetry.centre_m)


def _symmetry(data: SimulatedGrasps) -> Symmetry | None:
    """Of the true surface or outline; None if its rotations can be distinguished."""
    if isinstance(data, SpatialGrasps):
        turns = symmetry_turns(data.mesh)
        return None if turns is None else Symmetry(turns, ORIGIN_m)
    return outline_symmetry(data.outline_m) if isinstance(data, PlanarGrasps) else None


def _within(errors_m: Array, sigma_m: Array) -> float:
    return float(np.mean(errors_m <= 2 * sigma_m))


def _shape_figures(errors: ShapeErrors, covered: float, closed: bool, judged: SurfaceConsistency) -> dict[str, Any]:
    return {
        "hausdorff_mm": 1e3 * errors.hausdorff_m,
        "mean_mm": 1e3 * errors.mean_distance_m,
        "iou": errors.iou,
        "within_2_sigma": covered,
        "closed": closed,
        "fscore_1mm": errors.fscore_1mm,
        "surface_inside": list(judged.inside),
        "surface_log_score": judged.log_score,
        "surface_signed_mm": judged.signed_mm,
    }


def size_figures(shape: Contour | SurfaceMesh | None, true_points_m: Array) -> dict[str, Any]:
    """Errors of the sizes of which both ends were touched: in stated standard deviations, and without sign in mm.

    Args:
        shape: as estimated; None if nothing is known, or if it does not stand on a table.
        true_points_m: of the true outline, shape (n, 2), or the vertices of the true surface, shape (n, 3), z up.
    """
    if shape is None:
        return NO_SIZES
    points_m = shape.points_m if isinstance(shape, Contour) else shape.vertices
    stated = sizes(points_m, shape.sigma_m, shape.known)
    pairs = [
        (size.whole, true.whole) for size, true in zip(stated, sizes(true_points_m), strict=True) if not size.is_guess
    ]
    off_m = [found.length_m - true.length_m for found, true in pairs]
    return {
        "size_z": [error_m / found.sigma_m for error_m, (found, _) in zip(off_m, pairs, strict=True)],
        "size_off_mm": [1e3 * abs(error_m) for error_m in off_m],
    }
