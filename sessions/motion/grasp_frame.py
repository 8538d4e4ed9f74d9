"""Where on the table a grasp is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gtsam import Pose2, Pose3, Rot3

from drivers.core.contacts import Array


@dataclass(frozen=True)
class GraspFrame:
    """A grasp frame on the table: world x, y of its origin and its yaw. The height is given by the closing."""

    x_m: float
    y_m: float
    yaw_rad: float

    @property
    def pose(self) -> Pose3:
        """``world_T_grasp``."""
        return Pose3(Rot3.Yaw(self.yaw_rad), np.array([self.x_m, self.y_m, 0.0]))

    @property
    def planar(self) -> Pose2:
        """The same on the table."""
        return Pose2(self.x_m, self.y_m, self.yaw_rad)

    def move(self, dx_m: float = 0.0, dy_m: float = 0.0, turn_rad: float = 0.0) -> GraspFrame:
        """Shifted along the world's axes and turned about its own origin."""
        return GraspFrame(self.x_m + dx_m, self.y_m + dy_m, self.yaw_rad + turn_rad)

    def shifted_inside(self, shift_grasp_m: Array) -> GraspFrame:
        """Shifted by a vector (2,) given in the grasp frame itself."""
        c, s = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        x, y = shift_grasp_m
        return self.move(float(c * x - s * y), float(s * x + c * y))
