"""The pose of a flat board in a picture, the other poses that its corners allow, and its covariance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from gtsam import Pose3

from drivers.camera.calibration import CameraCalibration
from drivers.camera.opencv import cv2
from drivers.camera.pose.joint_pose import cross_matrices
from drivers.camera.pose.square_pose import MarkerPose, points_reprojection_px, refine_pose
from drivers.core.contacts import Array
from drivers.core.poses import rotation_angle_rad, transform_points

_SAME_TURN_rad = 0.05


@dataclass(frozen=True, eq=False)
class BoardPose:
    """A board in a picture.

    Attributes:
        camera_T_board: its pose.
        reprojection_px: root mean square distance of the projected from the seen corners.
        others: further poses that its corners allow, with their errors.
        ambiguous: whether one of these explains the corners nearly as well.
        covariance: of rotation (rad) and translation (m), shape (6, 6), board frame; from the corners' noise.
    """

    camera_T_board: Pose3
    reprojection_px: float
    others: tuple[MarkerPose, ...]
    ambiguous: bool
    covariance: Array


def board_pose(
    points_m: Array, pixels: Array, camera: CameraCalibration, *, corner_sigma_px: float = 0.1, ratio: float = 3.0
) -> BoardPose | None:
    """The pose of a flat board from at least four of its corners; None if they do not determine one.

    A flat figure allows two poses (IPPE). The better one is refined and returned. It is marked ambiguous if the error
    of the other is below ``ratio`` times its own, or ``ratio`` times the corners' noise. The other pose is not refined:
    the error changes little between the two, so refinement could move it to the first pose and hide the ambiguity.
    """
    if len(points_m) < 4 or _in_one_line(points_m):
        return None
    # IPPE divides by zero where a picture is exactly symmetric, as simulated ones can be.
    starts = _starts(points_m, pixels, camera, cv2.SOLVEPNP_IPPE)
    starts = starts or _starts(points_m, pixels, camera, cv2.SOLVEPNP_ITERATIVE)
    if not starts:
        return None
    best = min((_refine(s, points_m, pixels, camera) for s in starts), key=lambda found: found.reprojection_px)
    floor = max(best.reprojection_px, np.sqrt(2.0) * corner_sigma_px)
    distinct = tuple(_assess(start, points_m, pixels, camera) for start in starts if _differs(start, best))
    return BoardPose(
        camera_T_board=best.camera_T_marker,
        reprojection_px=best.reprojection_px,
        others=distinct,
        ambiguous=any(found.reprojection_px < ratio * floor for found in distinct),
        covariance=pose_covariance(best.camera_T_marker, points_m, camera, corner_sigma_px),
    )


def pose_covariance(camera_T_points: Pose3, points_m: Array, camera: CameraCalibration, sigma_px: float) -> Array:
    """Covariance of a pose from the noise of its points' pixels: rotation, translation in the points' frame, (6, 6)."""
    _, by_camera = camera.projection(transform_points(camera_T_points, points_m))
    by_point = by_camera @ camera_T_points.rotation().matrix()
    turns = -by_point @ cross_matrices(points_m)
    rows = np.concatenate([turns, by_point], axis=2).reshape(-1, 6) / sigma_px
    return np.asarray(np.linalg.pinv(rows.T @ rows))


def _starts(points_m: Array, pixels: Array, camera: CameraCalibration, method: int) -> list[Pose3]:
    """The finite ones of a method's poses."""
    good, rotations, translations, _ = cv2.solvePnPGeneric(
        points_m, pixels, camera.matrix, camera.distortion_coefficients, flags=method
    )
    found = [_pose(r, t) for r, t in zip(rotations, translations, strict=True)] if good else []
    return [start for start in found if np.isfinite(start.matrix()).all()]


def _refine(start: Pose3, points_m: Array, pixels: Array, camera: CameraCalibration) -> MarkerPose:
    return _assess(refine_pose(start, points_m, pixels, camera), points_m, pixels, camera)


def _assess(pose: Pose3, points_m: Array, pixels: Array, camera: CameraCalibration) -> MarkerPose:
    return MarkerPose(pose, points_reprojection_px(pose, points_m, pixels, camera))


def _differs(pose: Pose3, best: MarkerPose) -> bool:
    """Whether two poses differ by a larger rotation than any refinement makes."""
    return rotation_angle_rad(pose.between(best.camera_T_marker)) > _SAME_TURN_rad


def _in_one_line(points_m: Array) -> bool:
    spread = np.linalg.svd(points_m - points_m.mean(axis=0), compute_uv=False)
    return bool(spread[1] < 1e-6)


def _pose(rotation_vector: Any, translation: Any) -> Pose3:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = cv2.Rodrigues(rotation_vector)[0], np.ravel(translation)
    return Pose3(matrix)
