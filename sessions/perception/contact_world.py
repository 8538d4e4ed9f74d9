"""From a touch in a finger's distal frame to a contact in the world, with what is known about its error.

The covariance of a contact point is the sum of three independent parts:

* the sensor's own, rotated into the world;
* the joint angles', through the finger's Jacobian: the joint sensors carry a bias of about 0.6 deg that no averaging
  removes, so that all contacts of a finger share it. The wrist is left out: its error moves all contacts alike, as the
  mounting's does;
* the forearm-to-world calibration's, where its covariance is known.

The direction of the normal gets the same three parts as one standard deviation per axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import FINGERS, Array, Contact
from drivers.core.fingertip import TipContact
from drivers.shadow.model.kinematics import JOINTS, palm_T_distal_matrices
from drivers.shadow.protocol.palm_images import Side

_STEP_rad = 1e-4
"""Step of the central differences: error about 1e-9 of a link's length."""


def _same_numbered_joints() -> Array:
    """Rows select J1 of all fingers, J2 of all fingers, ... J5, shape (5, 24): no finger shares a joint."""
    names = [[f"{finger}J{number}" for finger in FINGERS] for number in range(1, 6)]
    return np.array([[float(joint in group) for joint in JOINTS] for group in names])


_GROUPS = _same_numbered_joints()


@dataclass(frozen=True)
class MountUncertainty:
    """Covariance of ``world_T_mount``.

    Attributes:
        world_T_mount: the calibrated pose, homogeneous matrix, shape (4, 4).
        covariance: shape (6, 6), of a small motion applied on the mount's side, rotation [rad] first, then
            translation [m] (gtsam's order for Pose3).
    """

    world_T_mount: Array
    covariance: Array

    def at(self, point_world_m: Array) -> tuple[Array, Array]:
        """Covariance of a point that moves with the mount, and of its rotation, both (3, 3), world frame."""
        rotation, origin = self.world_T_mount[:3, :3], self.world_T_mount[:3, 3]
        point_mount_m = rotation.T @ (point_world_m - origin)
        jacobian = rotation @ np.hstack([-_skew(point_mount_m), np.eye(3)])
        turn = rotation @ self.covariance[:3, :3] @ rotation.T
        return jacobian @ self.covariance @ jacobian.T, turn


class HandGeometry:
    """Poses of palm and fingertips, and their derivatives by the joints.

    Args:
        joints_rad: joint angles, shape (24,), radians.
        world_T_palm: homogeneous matrix, shape (4, 4).
        side: of the hand.
    """

    def __init__(self, joints_rad: Array, world_T_palm: Array, side: Side = "right") -> None:
        self._joints_rad, self.world_T_palm, self._side = joints_rad, world_T_palm, side
        self.world_T_distal: Array = world_T_palm @ palm_T_distal_matrices(joints_rad, side)
        """Distal frames, shape (5, 4, 4), order of :data:`FINGERS`."""

    def joint_derivatives(self) -> Array:
        """Derivatives of ``world_T_distal`` by J1 .. J5 of the finger itself, shape (5 joints, 5 fingers, 4, 4)."""
        ahead = palm_T_distal_matrices(self._joints_rad + _STEP_rad * _GROUPS, self._side)
        behind = palm_T_distal_matrices(self._joints_rad - _STEP_rad * _GROUPS, self._side)
        return np.asarray(self.world_T_palm @ ((ahead - behind) / (2 * _STEP_rad)))

    def contacts(
        self, tips: dict[str, TipContact], joint_sigma_rad: float, mount: MountUncertainty | None
    ) -> tuple[Contact, ...]:
        """The touches of one grasp in the world frame, in the order of :data:`FINGERS`."""
        derivatives = self.joint_derivatives()
        return tuple(
            _contact(finger, tips[finger], self.world_T_distal[i], derivatives[:, i], joint_sigma_rad, mount)
            for i, finger in enumerate(FINGERS)
            if finger in tips
        )


def _contact(
    finger: str,
    tip: TipContact,
    world_T_distal: Array,
    derivatives: Array,
    joint_sigma_rad: float,
    mount: MountUncertainty | None,
) -> Contact:
    rotation = world_T_distal[:3, :3]
    point = rotation @ tip.point_distal_m + world_T_distal[:3, 3]
    normal = rotation @ tip.normal_distal
    moves = derivatives[:, :3, :3] @ tip.point_distal_m + derivatives[:, :3, 3]
    turns = _rotation_vectors(derivatives[:, :3, :3] @ rotation.T)
    by_joints = joint_sigma_rad * moves.T
    covariance = rotation @ tip.point_covariance_m2 @ rotation.T + by_joints @ by_joints.T
    turn_covariance = joint_sigma_rad**2 * turns.T @ turns
    if mount is not None:
        mount_covariance, mount_turn = mount.at(point)
        covariance, turn_covariance = covariance + mount_covariance, turn_covariance + mount_turn
    return Contact(
        finger=finger,
        point_world_m=point,
        normal_world=normal / np.linalg.norm(normal),
        point_covariance_m2=(covariance + covariance.T) / 2,
        normal_sigma_rad=float(np.sqrt(tip.normal_sigma_rad**2 + _tilt_variance(turn_covariance, normal))),
        force_N=tip.force_N,
        shared_moves_m=by_joints,
    )


def _tilt_variance(turn_covariance: Array, normal: Array) -> float:
    """Variance of a direction's tilt per axis: rotations about the direction itself do not tilt it."""
    return float(max(0.0, (np.trace(turn_covariance) - normal @ turn_covariance @ normal) / 2))


def _rotation_vectors(skew: Array) -> Array:
    """The vectors of skew matrices (n, 3, 3), shape (n, 3)."""
    return np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=-1)


def _skew(vector: Array) -> Array:
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
