"""The straight way on which a column of fingertips comes toward a side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array
from drivers.shadow.closing.closing import Closing
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import TouchPlace
from sessions.motion.motion import Motion
from sessions.motion.probing.touch_patterns import Pattern


@dataclass(frozen=True)
class Lane:
    """A way toward a side.

    Attributes:
        table, column: the closing and the fingers' arrangement.
        place: where the side is expected.
        row_m: of the fingertips in the closing's grasp frame.
        past_m: how far the way goes on behind the place.
    """

    table: Closing
    column: Pattern
    place: TouchPlace
    row_m: float
    past_m: float

    @property
    def frame(self) -> GraspFrame:
        """In which the fingertips are in the lane."""
        return self.place.frame.shifted_inside(np.array([-self.row_m, 0.0]))

    @property
    def ahead(self) -> Array:
        """The direction of the way, world frame."""
        return np.asarray(self.frame.pose.rotation().rotate(np.array(self.table.approach)))

    def joints(self, motion: Motion, away_m: float) -> Array:
        """The positioner's, so far before the place."""
        return motion.base_joints(self.frame, self.table, self.place.height_m - self.table.height_m, away_m)
