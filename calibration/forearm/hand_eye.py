"""Closed forms of hand-eye calibration: AX = XB and AX = ZB.

``A_i`` is the hand in the mount's frame, ``B_i`` the marker in the camera's, ``X`` the marker on the hand and ``Z`` the
camera in the mount's frame: ``A_i X = Z B_i``. From two poses on, relative motions give ``A X = X B`` with
``A = A_i^-1 A_j`` and ``B = B_i^-1 B_j``; Park and Martin, "Robot sensor calibration: solving AX = XB on the Euclidean
group" (IEEE Trans. Robotics and Automation 1994). Both at once: Shah, "Solving the robot-world/hand-eye calibration
problem using the Kronecker product" (J. Mechanisms and Robotics 2013).

Neither detects insufficient motion; :mod:`calibration.steps.motion_check` checks it before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.contacts import Array


@dataclass(frozen=True, eq=False)
class HandEye:
    """A closed-form answer.

    Attributes:
        hand_T_target: X, the marker on the hand.
        mount_T_camera: Z, the camera in the mount's frame.
    """

    hand_T_target: Pose3
    mount_T_camera: Pose3


def solve_ax_xb(mount_T_hand: Sequence[Pose3], camera_T_target: Sequence[Pose3]) -> HandEye:
    """X from all relative motions (Park and Martin), then Z as the mean over the poses."""
    pairs = list(combinations(range(len(mount_T_hand)), 2))
    a = [mount_T_hand[i].inverse() * mount_T_hand[j] for i, j in pairs]
    b = [camera_T_target[i].inverse() * camera_T_target[j] for i, j in pairs]
    turns_a, turns_b = (np.array([Rot3.Logmap(pose.rotation()) for pose in motion]) for motion in (a, b))
    rotation = nearest_rotation(turns_a.T @ turns_b)
    left = np.concatenate([pose.rotation().matrix() - np.eye(3) for pose in a])
    right = np.concatenate([rotation @ q.translation() - p.translation() for p, q in zip(a, b, strict=True)])
    translation = np.linalg.lstsq(left, right, rcond=None)[0]
    hand_T_target = Pose3(Rot3(rotation), translation)
    return HandEye(hand_T_target, _mean_camera(mount_T_hand, camera_T_target, hand_T_target))


def solve_ax_zb(mount_T_hand: Sequence[Pose3], camera_T_target: Sequence[Pose3]) -> HandEye:
    """X and Z together (Shah): rotations from the Kronecker product's singular vectors, then both translations."""
    rotations_a = np.array([pose.rotation().matrix() for pose in mount_T_hand])
    rotations_b = np.array([pose.rotation().matrix() for pose in camera_T_target])
    kronecker = np.einsum("nij,nkl->ikjl", rotations_b, rotations_a).reshape(9, 9)
    left, _, right = np.linalg.svd(kronecker)
    x, z = (_unvec(vector) for vector in (right[0], left[:, 0]))
    sign = np.sign(np.linalg.det(x))
    rotation_x, rotation_z = nearest_rotation(sign * x), nearest_rotation(sign * z)
    translations_b = np.array([pose.translation() for pose in camera_T_target])
    translations_a = np.array([pose.translation() for pose in mount_T_hand])
    system = np.concatenate([np.hstack([np.eye(3), -rotation]) for rotation in rotations_a])
    wanted = (translations_a - translations_b @ rotation_z.T).ravel()
    z_m, x_m = np.split(np.linalg.lstsq(system, wanted, rcond=None)[0], 2)
    return HandEye(Pose3(Rot3(rotation_x), x_m), Pose3(Rot3(rotation_z), z_m))


def nearest_rotation(matrix: Array) -> Array:
    """The rotation nearest to a matrix, shape (3, 3)."""
    u, _, v = np.linalg.svd(matrix)
    return np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v)


def mean_pose(poses: Sequence[Pose3]) -> Pose3:
    """Mean translation, and the rotation nearest to the mean of the rotation matrices."""
    rotation = nearest_rotation(np.mean([pose.rotation().matrix() for pose in poses], axis=0))
    return Pose3(Rot3(rotation), np.mean([pose.translation() for pose in poses], axis=0))


def _mean_camera(mount_T_hand: Sequence[Pose3], camera_T_target: Sequence[Pose3], hand_T_target: Pose3) -> Pose3:
    return mean_pose([a * hand_T_target * b.inverse() for a, b in zip(mount_T_hand, camera_T_target, strict=True)])


def _unvec(vector: Array) -> Array:
    return np.asarray(vector).reshape(3, 3).T
