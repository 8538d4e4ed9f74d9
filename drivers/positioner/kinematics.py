"""Kinematics of the six-axis positioner that carries the hand.

Axes in order x, y, z (metres), yaw, pitch, roll (radians). ``mount_T_forearm = Trans(x, y, z) Rz(yaw) Ry(pitch)
Rx(roll) R0`` with ``R0 = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]``: at zero the palm faces down and the fingers point along
the mount's x axis.
"""

from __future__ import annotations

import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.contacts import Array

_ZERO_ROTATION = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
_UPRIGHT = 1e-9


def mount_T_forearm(q: Array) -> Pose3:
    """The forearm in the mount's frame, from six axes, shape (6,), metres and radians."""
    rotation = Rot3.Ypr(float(q[3]), float(q[4]), float(q[5])).matrix() @ _ZERO_ROTATION
    return Pose3(Rot3(rotation), np.asarray(q[:3], dtype=float))


def mount_joints(mount_T_forearm: Pose3, near_yaw: float) -> Array:
    """The axes that put the forearm at a pose: the inverse of :func:`mount_T_forearm`.

    Args:
        mount_T_forearm: the wanted pose.
        near_yaw: of all equal yaws the one nearest to this is taken, so that a path does not turn back on itself.

    Returns:
        Shape (6,), metres and radians, with pitch in -pi/2..pi/2 and roll in -pi..pi. Where the pitch is upright
        only the sum of yaw and roll matters, and the yaw stays at ``near_yaw``.
    """
    rotation = mount_T_forearm.rotation().matrix() @ _ZERO_ROTATION.T
    level = np.hypot(rotation[0, 0], rotation[1, 0])
    pitch = np.arctan2(-rotation[2, 0], level)
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0]) if level > _UPRIGHT else near_yaw
    yaw += 2 * np.pi * np.round((near_yaw - yaw) / (2 * np.pi))
    _, cosine, minus_sine = -np.sin(yaw) * rotation[0] + np.cos(yaw) * rotation[1]  # second row of Ry(pitch) Rx(roll)
    roll = np.arctan2(-minus_sine, cosine)
    return np.array([*mount_T_forearm.translation(), yaw, pitch, roll])
