"""Arrangements of the fingertips in touches without a grasp."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from drivers.shadow.closing.closing import Closing, closing, side_with_first_finger_down, sideways
from drivers.shadow.closing.posture import HandShape
from drivers.shadow.closing.tip_motion import motor_rates


@dataclass(frozen=True)
class Pattern:
    """Arrangement of the fingertips in a touch.

    Attributes:
        closing: its paths.
        progress: position on them, by finger.
        held_rad: joint angles of fingers that are held out of the way, by finger and motor.
        shifted_rad: additional motor angles of fingers that are held back a little, by motor.
    """

    closing: str
    progress: Mapping[str, float]
    held_rad: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    shifted_rad: Mapping[str, float] = field(default_factory=dict)

    def aside(self, table: Closing) -> dict[str, float]:
        """Additional motor angles, relative to the closing's table, to hold those fingers, or to hold them back."""
        wanted = {motor: angle for motors in self.held_rad.values() for motor, angle in motors.items()}
        tabled = {m: a for finger in self.held_rad for m, a in table.joints(finger, self.progress[finger]).items()}
        return {**self.shifted_rad, **{motor: wanted[motor] - angle for motor, angle in tabled.items()}}


TAP = Pattern("radial", {"FF": 0.70, "MF": 0.86, "RF": 0.78, "LF": 0.68, "TH": 0.62})
"""Five fingertips around the middle of the grasp frame, far enough apart not to touch each other."""

ROW = Pattern(
    "pinch",
    {"FF": 0.75, "MF": 0.75, "RF": 0.75, "LF": 0.75, "TH": 0.0},
    {"TH": {"THJ1": 0.0, "THJ2": -0.6, "THJ3": 0.0, "THJ4": 0.0, "THJ5": -1.0}},
)
"""The four fingers in a row, the thumb beside them 100 mm above the table."""

COLUMN = Pattern("pinch", {"FF": 0.75, "MF": 0.75, "RF": 0.75, "LF": 0.75, "TH": 0.0})
"""The four fingers in a row; with the palm upright one above the other, the open thumb beside them."""

TAP_HEIGHT_m = 0.022
"""Height of the closing's table; the positioner adds the rest."""

_HELD_BACK_m = 0.010

_PALM_m = 0.055
"""The upright palm stays so far above the table: the forearm behind it is 100 mm thick."""


def lowest_touch_m(side: str, heights_m: tuple[float, float], hand: HandShape) -> float:
    """How low the lowest fingertip of the column may be.

    Args:
        side: where the palm stands, one of :data:`~drivers.shadow.closing.closing.SIDES`.
        heights_m: with the first finger down, and up; higher for a hand that has fewer fingers below its palm then.
        hand: that touches.
    """
    height_m = heights_m[0 if side == side_with_first_finger_down(hand.form) else 1]
    palm_m = float(closing(sideways(COLUMN.closing, side), height_m, hand).grasp_T_palm.z())
    return height_m + max(0.0, _PALM_m - palm_m)


def lowest_ahead(table: Closing, hand: HandShape, up_to_m: float) -> Pattern:
    """The column, with the lowest fingertips 10 mm ahead of the others: an object that is met low down does not tip.

    Args:
        table: the closing that it belongs to, palm upright.
        hand: that has it.
        up_to_m: fingertips up to this height are all ahead, otherwise only the lowest.
    """
    tips_m = {finger: table.path(finger).centre_m(COLUMN.progress[finger]) for finger in table.fingers}
    heights_m = {finger: float(place[2]) for finger, place in tips_m.items() if finger != "TH"}
    lowest_m = min(heights_m.values())
    rates = motor_rates(table, COLUMN.progress, -np.array(table.approach), hand)
    behind = [finger for finger, height_m in heights_m.items() if height_m > max(up_to_m, lowest_m)]
    shifted_rad = {motor: _HELD_BACK_m * rate for finger in behind for motor, rate in rates[finger].items()}
    return replace(COLUMN, shifted_rad=shifted_rad)
