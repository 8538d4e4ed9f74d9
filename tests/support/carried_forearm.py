"""What hangs on an emulated control box: a forearm that is wherever it was put. And the program that a box runs."""

from __future__ import annotations

import numpy as np
from gtsam import Pose3, Rot3

PROGRAM = 'def program():\n  textmsg("RTDE Control Script Loaded")\nend\n'


class Forearm:
    """Stands for the forearm in the simulated world."""

    def __init__(self) -> None:
        self.pose = Pose3(Rot3.Pitch(0.3), np.array([0.5, 0.1, 0.4]))

    def place(self) -> Pose3:
        """Where it is."""
        return self.pose

    def move(self, base_T_forearm: Pose3) -> None:
        """Put it elsewhere."""
        self.pose = base_T_forearm
