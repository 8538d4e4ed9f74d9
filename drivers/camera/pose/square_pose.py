"""The two poses that the corners of a flat square allow, and the pose near a guess that fits points to pixels best.

The poses follow from the homography between square and picture, whose derivative at the square's middle is a rotation
seen in perspective: infinitesimal plane-based pose estimation (IPPE, Collins and Bartoli, 2014).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from gtsam import Pose3

from drivers.camera.calibration import CameraCalibration
from drivers.camera.markers import marker_corners
from drivers.core.contacts import Array
from drivers.core.poses import transform_points
from drivers.core.rotations import skew

_ROUNDS, _ENOUGH = 30, 1e-10
_NEVER_ZERO = 1e-30
"""Corners that lie in one point allow no pose; whatever they get fits badly."""
_FIRST_DAMPING, _LARGEST_DAMPING, _TENFOLD = 1e-3, 1e6, 10.0


@dataclass(frozen=True)
class MarkerPose:
    """One of the two poses that a square's four corners allow.

    Attributes:
        camera_T_marker: the pose.
        reprojection_px: root mean square distance of the projected corners from the seen ones.
    """

    camera_T_marker: Pose3
    reprojection_px: float


def marker_poses(corners_px: Array, side_m: float, camera: CameraCalibration) -> tuple[MarkerPose, ...]:
    """Both poses of a single square (IPPE), the better one first; the second is nearly the mirror image of the first.

    For distant, small or nearly face-on squares both have almost the same error.
    """
    corners_m, seen = marker_corners(side_m), camera.rays(corners_px)[:, :2]
    poses = [_placed(rotation, corners_m, seen) for rotation in _rotations(_homography(corners_m, seen))]
    found = [MarkerPose(pose, reprojection_px(pose, corners_px, side_m, camera)) for pose in poses]
    return tuple(sorted(found, key=lambda each: each.reprojection_px))


def refine_pose(camera_T_points: Pose3, points_m: Array, pixels: Array, camera: CameraCalibration) -> Pose3:
    """The pose near an initial guess that minimizes the distances of points (n, 3) to their pixels (n, 2).

    Levenberg-Marquardt; the guess is returned where no step brings the points nearer.
    """
    pose, damping = camera_T_points, _FIRST_DAMPING
    rows, errors = _linearise(pose, points_m, pixels, camera)
    for _ in range(_ROUNDS):
        normal = rows.T @ rows
        step = np.linalg.lstsq(normal + damping * np.diag(np.diag(normal)), -rows.T @ errors, rcond=None)[0]
        changed = Pose3.Expmap(step) * pose
        new_rows, new_errors = _linearise(changed, points_m, pixels, camera)
        if new_errors @ new_errors < errors @ errors:
            pose, rows, errors = changed, new_rows, new_errors
            damping /= _TENFOLD
        else:
            damping *= _TENFOLD
        if np.abs(step).max() < _ENOUGH or damping > _LARGEST_DAMPING:
            break
    return pose


def reprojection_px(camera_T_marker: Pose3, corners_px: Array, side_m: float, camera: CameraCalibration) -> float:
    """Root mean square distance between the projected and the seen corners, pixels."""
    return points_reprojection_px(camera_T_marker, marker_corners(side_m), corners_px, camera)


def points_reprojection_px(camera_T_points: Pose3, points_m: Array, pixels: Array, camera: CameraCalibration) -> float:
    """Root mean square distance between projected points (n, 3) and pixels (n, 2)."""
    projected = camera.project(transform_points(camera_T_points, points_m))
    return float(np.sqrt(np.mean(np.sum((projected - pixels) ** 2, axis=1))))


def _linearise(pose: Pose3, points_m: Array, pixels: Array, camera: CameraCalibration) -> tuple[Array, Array]:
    """Derivatives of the pixels with respect to a change of the pose on the camera's side, (2n, 6); errors (2n,)."""
    seen = transform_points(pose, points_m)
    projected, by_place = camera.projection(seen)
    rows = np.concatenate([-by_place @ skew(seen), by_place], axis=2)
    return rows.reshape(-1, 6), (projected - pixels).ravel()


def _homography(corners_m: Array, seen: Array) -> Array:
    """The mapping of the square's plane to the picture, shape (3, 3) with one at the end, from four points each."""
    (x, y), (u, v) = corners_m[:, :2].T, seen.T
    one, zero = np.ones(4), np.zeros(4)
    across = np.stack([x, y, one, zero, zero, zero, -u * x, -u * y], axis=1)
    down = np.stack([zero, zero, zero, x, y, one, -v * x, -v * y], axis=1)
    entries = np.linalg.lstsq(np.concatenate([across, down]), np.concatenate([u, v]), rcond=None)[0]
    return np.append(entries, 1.0).reshape(3, 3)


def _rotations(homography: Array) -> Iterator[Array]:
    """The two rotations of the square, shape (3, 3) each, that its homography allows at its middle."""
    middle = homography[:2, 2]
    slope = homography[:2, :2] - np.outer(middle, homography[2, :2])
    along = _turn_to(np.append(middle, 1.0))
    turned = np.linalg.solve(along[:2, :2] - np.outer(middle, along[2, :2]), slope)
    upper = turned / max(float(np.linalg.norm(turned, ord=2)), _NEVER_ZERO)
    missing = np.eye(2) - upper.T @ upper
    depth = np.sqrt(np.maximum(np.diag(missing), 0.0)) * [1.0, 1.0 if missing[0, 1] >= 0.0 else -1.0]
    for sign in (1.0, -1.0):
        columns = np.vstack([upper, sign * depth])
        yield along @ np.column_stack([columns, np.cross(columns[:, 0], columns[:, 1])])


def _turn_to(direction: Array) -> Array:
    """The smallest rotation that turns the z axis to a direction before the camera, shape (3, 3)."""
    x, y, z = direction / np.linalg.norm(direction)
    share = 1.0 / (1.0 + z)
    return np.array([[1 - share * x * x, -share * x * y, x], [-share * x * y, 1 - share * y * y, y], [-x, -y, z]])


def _placed(rotation: Array, corners_m: Array, seen: Array) -> Pose3:
    """The pose of that rotation whose corners come nearest to where they are seen, at a distance of one."""
    turned = corners_m @ rotation.T
    one, zero = np.ones(len(seen)), np.zeros(len(seen))
    across = np.stack([one, zero, -seen[:, 0]], axis=1)
    down = np.stack([zero, one, -seen[:, 1]], axis=1)
    wanted = seen * turned[:, 2:] - turned[:, :2]
    place = np.linalg.lstsq(np.concatenate([across, down]), wanted.T.ravel(), rcond=None)[0]
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, place
    return Pose3(matrix)
