"""Figures of merit of one run: how good the shape, the tracking and the stated uncertainty are, and how long it took.

Shape: Hausdorff and mean distance (appendix C) after the best rigid alignment. Tracking: registration error.
For solids that a turn about their own axis leaves alike, the contacts of each grasp may be turned so first: no
contact can tell. Uncertainty: share of the surface whose true error is within two stated standard deviations.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import trimesh
from gtsam import Pose3, Rot3

from tactile_lab.evaluation.registration import registration_rms_mm
from tactile_lab.evaluation.trajectory import Poses
from tactile_lab.experiments.planar_data import PlanarGrasps
from tactile_lab.experiments.sensing import SimulatedGrasps
from tactile_lab.experiments.solids import ANY_TURN, OWN_TURNS
from tactile_lab.experiments.spatial_data import SpatialGrasps
from tactile_lab.geometry.contacts import Array
from tactile_lab.geometry.poses import spatial, transform_points
from tactile_lab.shape.alignment import align_contours, align_meshes
from tactile_lab.shape.metrics import ShapeErrors, contour_errors, mesh_errors
from tactile_lab.shape.sampling import distances_to_mesh, distances_to_polygon
from tactile_lab.shape.surface import Contour, SurfaceMesh
from tactile_lab.slam_result import SlamResult

NO_SHAPE: dict[str, Any] = {"hausdorff_mm": None, "mean_mm": None, "iou": None, "within_2_sigma": None}


def contour_figures(contour: Contour | None, outline_m: Array) -> dict[str, Any]:
    """Of an estimated outline against the true one, shape (n, 2)."""
    if contour is None:
        return dict(NO_SHAPE)
    fit = align_contours(contour.points_m, outline_m)
    moved = transform_points(spatial(fit), np.pad(contour.points_m, ((0, 0), (0, 1))))[:, :2]
    covered = _within(distances_to_polygon(moved, outline_m), contour.sigma_m)
    return _shape_figures(contour_errors(contour.points_m, outline_m, fit), covered, contour.is_closed)


def mesh_figures(mesh: SurfaceMesh | None, truth: trimesh.Trimesh, *, upright: bool = True) -> dict[str, Any]:
    """Of an estimated surface against the true one; upright turns about the vertical only to find the best fit."""
    if mesh is None:
        return dict(NO_SHAPE)
    fit = align_meshes(mesh, truth, upright=upright)
    covered = _within(distances_to_mesh(transform_points(fit, mesh.vertices), truth), mesh.sigma_m)
    return _shape_figures(mesh_errors(mesh, truth, fit), covered, mesh.is_closed)


def slam_figures(data: SimulatedGrasps, result: SlamResult) -> dict[str, Any]:
    """Of a whole run."""
    if isinstance(data, PlanarGrasps):
        shape = contour_figures(result.contour, data.outline_m)
    elif isinstance(data, SpatialGrasps):
        shape = mesh_figures(result.mesh, data.mesh, upright=_upright(data.world_T_body))
    contacts = [grasp.points_world_m for grasp in data.grasps]
    poses = result.world_T_object
    if data.shape in OWN_TURNS and _upright(data.world_T_body):
        poses = without_own_turns(poses, data.world_T_body, OWN_TURNS[data.shape])
    return {
        **shape,
        "registration_mm": registration_rms_mm(contacts, poses, data.world_T_body, result.dimension),
        "status": result.status,
        "contacts": sum(map(len, contacts)),
        "untracked": sum(step.verdict == "untracked" for step in result.steps),
        "step_ms": [round(1e3 * seconds, 3) for seconds in result.step_seconds[1:]],
    }


def without_own_turns(
    estimate: Poses, world_T_body: Sequence[Pose3], turns: int = ANY_TURN
) -> tuple[Pose3 | None, ...]:
    """Estimated poses of a solid on the table, turned about its axis towards the heading it truly has.

    The axis in the estimated object frame is where the estimates place the true axis, in the mean over all grasps.

    Args:
        estimate: poses, None where there is none.
        world_T_body: true poses.
        turns: how many turns of a full one leave the solid as it is; :data:`ANY_TURN` for a round one.
    """
    pairs = [(pose, truth) for pose, truth in zip(estimate, world_T_body, strict=True) if pose is not None]
    if not pairs:
        return tuple(estimate)
    axis_m = np.mean([pose.transformTo(truth.translation()) for pose, truth in pairs], axis=0)
    heading = pairs[0][1].rotation().inverse() * pairs[0][0].rotation()
    return tuple(
        None if pose is None else _about(axis_m, pose, _own_turn(pose.rotation(), truth.rotation() * heading, turns))
        for pose, truth in zip(estimate, world_T_body, strict=True)
    )


def _own_turn(estimated: Rot3, true: Rot3, turns: int) -> Rot3:
    """The rotation that looks like the estimated one and is nearest to the true one."""
    if turns == ANY_TURN:
        return true
    step = 2 * np.pi / turns
    return estimated * Rot3.Rz(step * round((estimated.inverse() * true).yaw() / step))


def _about(axis_object_m: Array, pose: Pose3, rotation: Rot3) -> Pose3:
    """The pose with another rotation, the axis staying where it is in the world."""
    return Pose3(rotation, pose.transformFrom(axis_object_m) - rotation.rotate(axis_object_m))


def _upright(world_T_body: tuple[Pose3, ...]) -> bool:
    return all(abs(pose.rotation().matrix()[2, 2] - 1.0) < 1e-9 for pose in world_T_body)


def _within(errors_m: Array, sigma_m: Array) -> float:
    return float(np.mean(errors_m <= 2 * sigma_m))


def _shape_figures(errors: ShapeErrors, covered: float, closed: bool) -> dict[str, Any]:
    return {
        "hausdorff_mm": 1e3 * errors.hausdorff_m,
        "mean_mm": 1e3 * errors.mean_distance_m,
        "iou": errors.iou,
        "within_2_sigma": covered,
        "closed": closed,
    }
