"""Errors of the estimated shape in the truth's object frame, computed twice.

Once aligned by the first grasp's true pose, which includes the error of the estimated pose, and once after the best
rigid alignment, which measures the shape alone (the thesis reports the second).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from gtsam import Pose3

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from drivers.core.poses import planar, spatial, transform_points
from tactile_lab.evaluation.prism import open_ring, signed_area_m2
from tactile_lab.slam.shape.metrics.alignment import align_contours, align_meshes
from tactile_lab.slam.shape.metrics.metrics import ShapeErrors, contour_errors, mesh_errors
from tactile_lab.slam.shape.surfaces.sampling import TriangleMesh, distances_to_mesh, distances_to_polygon


@dataclass(frozen=True)
class ShapeComparison:
    """Errors of one shape with two alignments.

    Attributes:
        first_grasp: aligned by the first grasp's true pose; None if that is unknown.
        best_fit: after the best rigid alignment.
        truth_T_fitted: that alignment, from the estimate's object frame into the truth's.
    """

    first_grasp: ShapeErrors | None
    best_fit: ShapeErrors
    truth_T_fitted: Pose3


def compare_contour(contour_m: Array, truth_m: Array, truth_T_estimate: Pose3 | None) -> ShapeComparison:
    """Compare a contour of shape (n, 2), estimate's object frame, with the true outline, truth's object frame.

    Args:
        contour_m: estimated contour.
        truth_m: true outline, shape (m, 2).
        truth_T_estimate: from the first grasp's true pose; None if there is none.

    Raises:
        ShapeError: a contour without area or with coordinates that are not numbers.
    """
    start = None if truth_T_estimate is None else planar(truth_T_estimate)
    placed = None if start is None else contour_errors(contour_m, truth_m, start)
    fitted = align_contours(contour_m, truth_m)
    return ShapeComparison(placed, contour_errors(contour_m, truth_m, fitted), spatial(fitted))


def compare_mesh(mesh: TriangleMesh, truth: TriangleMesh, truth_T_estimate: Pose3 | None) -> ShapeComparison:
    """Compare a mesh with the true one, as :func:`compare_contour` does.

    The best fit rotates about the vertical only, since the object stands on the table throughout a session.

    Raises:
        ShapeError: a mesh without faces or with coordinates that are not numbers.
    """
    placed = None if truth_T_estimate is None else mesh_errors(mesh, truth, truth_T_estimate)
    fitted = align_meshes(mesh, truth, upright=True)
    return ShapeComparison(placed, mesh_errors(mesh, truth, fitted), fitted)


def horizontal_outline(mesh: trimesh.Trimesh, height_m: float) -> Array:
    """The outer outline of a mesh's horizontal section, shape (n, 2), counter-clockwise, first point not repeated.

    Args:
        mesh: watertight mesh, its object frame.
        height_m: height of the section in that frame; clamped to the mesh.

    Raises:
        ShapeError: the section is empty or open (a mesh that is not watertight).
    """
    low, high = (float(value) for value in mesh.bounds[:, 2])
    inset = 1e-3 * (high - low)
    section = mesh.section(
        plane_origin=[0.0, 0.0, np.clip(height_m, low + inset, high - inset)], plane_normal=[0, 0, 1]
    )
    rings = [] if section is None else [np.asarray(ring)[:, :2] for ring in section.discrete if len(ring) > 3]
    if not rings:
        raise ShapeError(
            "the true mesh has no closed section at the contacts", hint="Check that the mesh is watertight"
        )
    return open_ring(max(rings, key=lambda ring: abs(signed_area_m2(ring))))


def contact_distances_m(contacts_world_m: list[Array], truth: list[Pose3], mesh: TriangleMesh) -> Array:
    """Distance of each contact from the true surface at its time, shape (n,).

    It measures the sensing alone: joints, fingertips and calibration, without any estimated pose.
    """
    points = _in_truth(contacts_world_m, truth)
    return distances_to_mesh(points, mesh) if len(points) else np.zeros(0)


def outline_distances_m(contacts_world_m: list[Array], truth: list[Pose3], outline_m: Array) -> Array:
    """As :func:`contact_distances_m`, from the true outline of shape (m, 2), in the plane."""
    points = _in_truth(contacts_world_m, truth)
    return distances_to_polygon(points[:, :2], outline_m) if len(points) else np.zeros(0)


def _in_truth(contacts_world_m: list[Array], truth: list[Pose3]) -> Array:
    """All contacts in the truth's object frame, shape (n, 3)."""
    placed = [transform_points(pose.inverse(), points) for points, pose in zip(contacts_world_m, truth, strict=True)]
    return np.concatenate([*placed, np.zeros((0, 3))])


def contact_height_m(contacts_world_m: list[Array], truth: list[Pose3]) -> float:
    """Mean height of contacts in the truth's object frame, from the points (n, 3) and true pose of each grasp."""
    pairs = zip(contacts_world_m, truth, strict=True)
    heights = [pose.transformTo(point)[2] for points, pose in pairs for point in points]
    return float(np.mean(heights)) if heights else 0.0
