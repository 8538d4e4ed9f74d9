"""The field's standard trajectory error: positions after the best rigid alignment of the whole trajectory (Umeyama).

Other programs compute it from the files of :mod:`tactile_lab.evaluation.files.tum_file`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.contacts import Array
from drivers.core.poses import rotation_angle_rad
from tactile_lab.evaluation.trajectory import Compared, Poses, aligned_poses, compared_grasps

_FEWEST = 3
_LEAST_SPREAD_m = 0.001
"""Positions that lie closer to a line than this do not determine the rotation about it."""


@dataclass(frozen=True)
class StandardErrors:
    """Errors after the alignment, without scale.

    Attributes:
        grasps: number of poses compared.
        rmse_mm, largest_mm: distance of the positions.
        rmse_deg: angle between the frames; None if the positions do not determine the alignment's rotation.
    """

    grasps: int
    rmse_mm: float
    largest_mm: float
    rmse_deg: float | None


def standard_errors(estimate: Poses, truth: Poses) -> StandardErrors | None:
    """Error of the truth's object frame, placed by the estimate, after a rigid motion of the world that fits best.

    Args:
        estimate: estimated ``world_T_object``; its object frame is tied to the truth's at the first common grasp.
        truth: true poses.

    Returns:
        None for fewer than three grasps with both poses.
    """
    both = compared_grasps(aligned_poses(estimate, truth), truth)
    if len(both) < _FEWEST:
        return None
    places = np.array([pair.estimate.translation() for pair in both])
    true_places = np.array([pair.truth.translation() for pair in both])
    truth_T_estimate = best_rigid(places, true_places)
    moved = np.array([truth_T_estimate.transformFrom(place) for place in places])
    distances_mm = 1e3 * np.linalg.norm(moved - true_places, axis=1)
    turned = _rms_deg(both, truth_T_estimate) if min(map(_spread_m, (places, true_places))) > _LEAST_SPREAD_m else None
    return StandardErrors(len(both), float(np.sqrt(np.mean(distances_mm**2))), float(distances_mm.max()), turned)


def best_rigid(source_m: Array, target_m: Array) -> Pose3:
    """``target_T_source``, the rotation and translation of least squares between points of shape (n, 3)."""
    source_centre, target_centre = source_m.mean(axis=0), target_m.mean(axis=0)
    left, _, right = np.linalg.svd((target_m - target_centre).T @ (source_m - source_centre))
    mirror = np.diag([1.0, 1.0, np.linalg.det(left) * np.linalg.det(right)])
    rotation = Rot3(left @ mirror @ right)
    return Pose3(rotation, target_centre - rotation.rotate(source_centre))


def _spread_m(places_m: Array) -> float:
    """Extent of positions across the line that fits them best."""
    return float(np.linalg.svd(places_m - places_m.mean(axis=0), compute_uv=False)[1])


def _rms_deg(both: list[Compared], truth_T_estimate: Pose3) -> float:
    angles = [rotation_angle_rad(pair.truth.between(truth_T_estimate * pair.estimate)) for pair in both]
    return float(np.degrees(np.sqrt(np.mean(np.square(angles)))))
