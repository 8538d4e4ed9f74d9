"""A plan for a force fingertip: free in several orientations of the hand, then pressed and rolled about on the table.

For free wrenches the hand is turned high above the table, so that the tip's weight acts in all directions. For presses
the finger leans to the palm's side and to both others, where a fingertip has its shell.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from gtsam import Pose3, Rot3

from calibration.forearm.touch_plan import PlannedTouch
from calibration.steps.geometry import Patch
from calibration.steps.observations import Plane
from drivers.core.contacts import Array
from drivers.positioner.kinematics import mount_T_forearm
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm
from drivers.shadow.model.kinematics import forearm_T_palm_matrix

PALM_HEIGHT_m = 0.45
"""Height of the palm while it is turned: a stretched finger, and the forearm, stay clear of the table."""

TURNS_deg = ((0, 0), (-45, 0), (0, 115), (-35, 60), (-35, -60), (0, -115), (45, 0), (85, 0))
"""Pitch and roll of the positioner, fingers level and palm down at zero; fingers down in the end."""

LEANS_rad = tuple(np.radians([15.0, 28.0]))
ROLLED_rad = float(np.radians(100.0))
"""Largest turn about the finger, from where the palm's side of the tip is pressed."""

_DISTAL_AT_ZERO = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class PlannedFree:
    """The hand turned with nothing touched.

    Attributes:
        finger: whose wrench is taken; it is stretched.
        pitch_rad, roll_rad: of the positioner.
        form: the hand.
    """

    finger: str
    pitch_rad: float
    roll_rad: float
    form: HandForm = RIGHT_HAND

    @property
    def instruction(self) -> str:
        """The instruction as text."""
        pitch, roll = np.degrees([self.pitch_rad, self.roll_rad])
        return f"{self.finger} free, hand pitched {pitch:.0f} deg, rolled {roll:.0f} deg"

    def base_q(self, world_T_mount: Pose3, joints_rad: Array) -> Array:
        """Axes of the positioner, shape (6,), with the palm over the world's origin and joints as given, (24,)."""
        turned = np.array([0.0, 0.0, 0.0, 0.0, self.pitch_rad, self.roll_rad])
        palm = mount_T_forearm(turned).transformFrom(forearm_T_palm_matrix(joints_rad, self.form.side)[:3, 3])
        place = world_T_mount.transformTo(np.array([0.0, 0.0, PALM_HEIGHT_m]))
        return np.asarray(turned + np.concatenate([place - palm, np.zeros(3)]))


PlannedWrench: TypeAlias = PlannedFree | PlannedTouch


def plan_wrenches(finger: str, presses: int = 10, form: HandForm = RIGHT_HAND) -> tuple[PlannedWrench, ...]:
    """Orientations without a touch, then presses on the table's top, z = 0 of the world, near its origin.

    Args:
        finger: a long finger.
        presses: how many.
        form: the hand; a left one is turned the other way round.
    """
    turns = [np.radians((pitch, form.handedness * roll)).tolist() for pitch, roll in TURNS_deg]
    free = [PlannedFree(finger, pitch, roll, form) for pitch, roll in turns]
    return (*free, *(_press(finger, index, presses, form) for index in range(presses)))


def _press(finger: str, index: int, count: int, form: HandForm) -> PlannedTouch:
    """One turn about the finger after the other, to one side with a small lean and back with a large one."""
    share = 4.0 * (index + 0.5) / count - 1.0  # -1..1 on the way there, 1..3 on the way back
    turn = form.handedness * ROLLED_rad * (share if share <= 1.0 else 2.0 - share)
    lean = LEANS_rad[int(share > 1.0)]
    top = Plane("table top", np.zeros(3), np.array([0.0, 0.0, 1.0]), 1e-4)
    rotation = Rot3.Ypr(0.0, np.pi / 2 - lean, turn).matrix() @ _DISTAL_AT_ZERO
    return PlannedTouch(finger, Patch(top, np.zeros(3), np.zeros((2, 3))), np.zeros(3), rotation, form=form)
