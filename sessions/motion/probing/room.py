"""Where the open fingers have room to come down."""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array
from drivers.core.poses import planar
from drivers.shadow.closing.closing import closing
from drivers.shadow.closing.posture import HandShape
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.probing.bounding_box import BoundingBox
from sessions.perception.hand_odometry import HandMotion

_LANDING_m = 0.020
"""An open fingertip's centre must stay this far from where one has landed on the object."""


class Room:
    """What open fingers keep clear of: the bounding box that was felt, and places where the hand has landed.

    Args:
        hand: its form, and the shape of its fingertips.
    """

    def __init__(self, hand: HandShape) -> None:
        self._hand = hand
        self.box: BoundingBox | None = None
        """None before one was felt, and once the estimate knows better."""

        self.landings_m: list[Array] = []
        """Where fingertips landed since the object was moved last, world, shape (3,) each."""

    def has(self, plan: GraspPlan) -> bool:
        """Whether the open fingers of a grasp are clear."""
        if not self.landings_m and self.box is None:
            return True
        paths = closing(plan.closing, plan.height_m, self._hand).paths
        open_m = np.array([plan.frame.pose.transformFrom(paths[f].centre_m(paths[f].valid[0])) for f in paths])
        if self.box is not None and not self.box.is_clear(open_m[:, :2]):
            return False
        apart_m = open_m[:, None, :2] - np.array(self.landings_m).reshape(-1, 3)[None, :, :2]
        return bool(np.linalg.norm(apart_m, axis=-1).min(initial=np.inf) >= _LANDING_m)

    def on_landings(self, points_world_m: list[Array]) -> None:
        """Fingertips landed on the object at these points, shape (3,) each."""
        self.landings_m += points_world_m

    def on_carry(self, carried: HandMotion) -> None:
        """The hand carried the object, or left it where it is."""
        self.box = None if self.box is None else self.box.move(planar(carried.world))
        if not carried.is_rest:
            self.landings_m = []
