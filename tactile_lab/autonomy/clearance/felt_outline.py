"""What the contacts alone tell of where the object is, before there is an estimate of its shape.

Everything between contacts belongs to an object without notches. So where the first grasps were, no link of the hand
can come down, and a hand that heeds it does not push the object while it closes (decision 165).
"""

from __future__ import annotations

import numpy as np
from gtsam import Pose2
from scipy.spatial import ConvexHull, QhullError

from drivers.core.contacts import Array, Grasp
from drivers.shadow.closing.posture import HandShape
from sessions.motion.grasp_plan import GraspPlan
from tactile_lab.autonomy.clearance.collision_check import StandingObject, links_are_clear
from tactile_lab.slam.exploration.policy import Surface

_SPACING_m = 0.002


class FeltOutline:
    """The convex hull of all contacts since the object was found, carried along with it.

    Args:
        hand: its form, and the shape of its fingertips.
    """

    def __init__(self, hand: HandShape) -> None:
        self._hand = hand
        self._points_m: Array = np.empty((0, 2))
        self._pose = Pose2()
        self._surface: Surface | None = None

    def on_grasp(self, grasp: Grasp) -> None:
        """Fingertips closed on the object."""
        closed_m = [contact.point_world_m[:2] for contact in grasp.contacts if not contact.probed]
        inside_m = [self._pose.transformTo(point_m) for point_m in closed_m]
        self._points_m = np.concatenate([self._points_m, np.reshape(inside_m, (-1, 2))])
        self._surface = _hull(self._points_m)

    def on_carry(self, motion: Pose2) -> None:
        """The object was moved in the world."""
        self._pose = motion * self._pose

    def begin_anew(self) -> None:
        """The object lies in another way, or elsewhere."""
        self._points_m, self._pose, self._surface = np.empty((0, 2)), Pose2(), None

    def is_clear(self, plan: GraspPlan, top_m: float) -> bool:
        """Whether no link meets what was felt, if it is so high, before its fingertip touches."""
        if self._surface is None:
            return True
        target = StandingObject(self._surface, self._pose, 0.0, top_m)
        return bool(links_are_clear([plan], self._hand, target)[0])


def _hull(points_m: Array) -> Surface | None:
    """Closely spaced places on the convex hull of ``points_m``, shape (n, 2); None if they enclose nothing."""
    try:
        corners_m = points_m[ConvexHull(points_m).vertices]
    except (QhullError, ValueError):
        return None
    sides_m = np.roll(corners_m, -1, axis=0) - corners_m
    lengths_m = np.linalg.norm(sides_m, axis=1)
    counts = np.ceil(lengths_m / _SPACING_m).astype(int)
    side = np.repeat(np.arange(len(counts)), counts)
    along = (np.arange(len(side)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[side]
    places_m = corners_m[side] + along[:, None] * sides_m[side]
    normals = np.column_stack([sides_m[:, 1], -sides_m[:, 0]])[side] / lengths_m[side, None]
    following = np.roll(np.arange(len(side)), -1)
    return Surface(places_m, normals, np.zeros(len(side)), np.column_stack([np.arange(len(side)), following]))
