"""The covariance of a pose in one form for all kinds of tracking: position and rotation in the world, shape (6, 6)."""

from __future__ import annotations

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array
from drivers.core.rotations import logarithm, right_jacobian
from tactile_lab.slam.result import SlamResult

ON_TABLE = (0, 1, 5)
"""Components of a pose on a table: x, y, and the rotation about the vertical."""


def covariance_in_world(world_T_object: Pose3, covariance: Array) -> Array:
    """Covariance of the position (m) and of a small rotation about the world's axes (rad), shape (6, 6).

    Args:
        world_T_object: the pose.
        covariance: of (x, y, yaw), shape (3, 3): the other components become zero; or of position and rotation vector,
            shape (6, 6), as objects held free are tracked.
    """
    if len(covariance) == len(ON_TABLE):
        whole = np.zeros((6, 6))
        whole[np.ix_(ON_TABLE, ON_TABLE)] = covariance
        return whole
    chart = np.eye(6)
    chart[3:, 3:] = right_jacobian(-logarithm(world_T_object.rotation().matrix()))  # the left one: it turns the world
    return np.asarray(chart @ covariance @ chart.T)


def covariances_in_world(result: SlamResult) -> tuple[Array | None, ...]:
    """Those of a whole trajectory; None where pose or covariance is unknown."""
    return tuple(
        None if pose is None or covariance is None else covariance_in_world(pose, covariance)
        for pose, covariance in zip(result.world_T_object, result.covariances, strict=True)
    )


def pose_deviation(estimate: Pose3, truth: Pose3) -> Array:
    """Error of a pose in the same components, shape (6,): the small motion from truth to estimate in the world."""
    turn = estimate.rotation().matrix() @ truth.rotation().matrix().T
    return np.concatenate([estimate.translation() - truth.translation(), logarithm(turn)])
