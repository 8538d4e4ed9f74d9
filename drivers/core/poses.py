"""Helpers on gtsam poses. A transform is named target first: ``world_T_object`` maps object to world."""

from __future__ import annotations

import numpy as np
from gtsam import Pose2, Pose3, Rot3

from drivers.core.contacts import Array


def planar(pose: Pose3) -> Pose2:
    """The motion of ``pose`` in the table plane: x, y and the rotation about the vertical axis.

    The rotation is the one about z nearest to the pose's (the projection that also gives the least
    squares answer for slightly tilted frames).
    """
    rotation = pose.rotation().matrix()
    yaw = np.arctan2(rotation[1, 0] - rotation[0, 1], rotation[0, 0] + rotation[1, 1])
    return Pose2(float(pose.x()), float(pose.y()), float(yaw))


def spatial(pose: Pose2, height_m: float = 0.0) -> Pose3:
    """A planar pose lifted into space: rotation about z, origin at the given height."""
    return Pose3(Rot3.Yaw(pose.theta()), np.array([pose.x(), pose.y(), height_m]))


def transform_points(target_T_source: Pose3, points_m: Array) -> Array:
    """Points of shape (n, 3) from the source into the target frame."""
    matrix = target_T_source.matrix()
    return np.asarray(points_m @ matrix[:3, :3].T + matrix[:3, 3])


def rotate(target_T_source: Pose3, directions: Array) -> Array:
    """Directions of shape (n, 3) from the source into the target frame."""
    return np.asarray(directions @ target_T_source.rotation().matrix().T)


def rotation_angle_rad(pose: Pose3) -> float:
    """The angle of the pose's rotation, 0 to pi radians."""
    return float(np.linalg.norm(Rot3.Logmap(pose.rotation())))


def wrap_angle_rad(angle: Array | float) -> Array:
    """Angles brought into [-pi, pi)."""
    return np.asarray((np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi)


def palm_heading(world_T_palm: Pose3) -> float:
    """Direction of the palm's horizontal axis in the world, radians.

    The palm's z axis points along the fingers. Where that is close to vertical its x axis, to the thumb's side,
    is used instead.
    """
    axes = world_T_palm.rotation().matrix()
    along = axes[:2, 2] if np.linalg.norm(axes[:2, 2]) > 0.5 else axes[:2, 0]
    return float(np.arctan2(along[1], along[0]))
