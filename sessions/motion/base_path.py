"""The positioner's way from one place to another, on which the palm stays in the workspace."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array
from drivers.positioner.kinematics import mount_T_forearm
from drivers.shadow.model.kinematics import JOINTS, forearm_T_palm

STRAIGHT_WRIST = forearm_T_palm(np.zeros(len(JOINTS)))  # in the plane that a left hand is mirrored in
_CHECKS = 21
"""Places on the way that are looked at: a few millimetres apart, or degrees."""


def base_path(start: Array, end: Array, is_in_workspace: Callable[[Array], bool]) -> Callable[[float], Array]:
    """Joints, shape (6,), by progress from 0 to 1.

    Straight in the joints: the forearm moves straight, and the palm, which is ahead of it, swings out where the hand
    turns. Where it would leave the workspace the palm moves straight instead, and the forearm turns about it: the
    workspace is a disc, which holds everything between two places that it holds.

    Args:
        start, end: joints, shape (6,), metres and radians.
        is_in_workspace: whether the palm may be at a place, mount frame, shape (3,).
    """

    def straight(share: float) -> Array:
        return start + share * (end - start)

    palms_m = [palm_m(straight(float(share))) for share in np.linspace(0.0, 1.0, _CHECKS)]
    if all(is_in_workspace(place_m) for place_m in palms_m):
        return straight
    first_m, last_m = palms_m[0], palms_m[-1]

    def about_the_palm(share: float) -> Array:
        q = straight(share)
        q[:3] += first_m + share * (last_m - first_m) - palm_m(q)
        return q

    return about_the_palm


def palm_m(q: Array) -> Array:
    """The palm's origin, wrist straight, from the positioner's joints, shape (6,); mount frame, shape (3,)."""
    palm: Pose3 = mount_T_forearm(q) * STRAIGHT_WRIST
    return np.asarray(palm.translation())
