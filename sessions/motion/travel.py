"""How high the hand travels."""

from __future__ import annotations

from drivers.shadow.closing.closing import Closing
from drivers.shadow.closing.hand_envelope import open_hand
from drivers.shadow.closing.posture import HandShape
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.motion import Motion

_FINGERS_HANG_m = 0.125
"""Below the palm's origin, when the palm faces down."""

_PASSED_OVER_m = 0.08


def travel_height_m(table: Closing, motion: Motion, cycle: CycleSettings, hand: HandShape) -> float:
    """How far above a grasp the hand travels, all of it above the tallest thing that may stand on the table.

    A palm that is upright turns over on its way to other grasps: the fingers then hang below it.
    """
    lowest_m = open_hand(table.name, table.height_m, hand).lowest_m
    if table.is_sideways:
        lowest_m = min(lowest_m, float(table.grasp_T_palm.z()) - _FINGERS_HANG_m)
    above_m = 0.0 if motion.tallest_m is None else motion.tallest_m + cycle.clearance_m - lowest_m
    return max(cycle.lift_m, above_m)


def top_at_most_m(motion: Motion) -> float:
    """How high the object's top is; what nobody has felt is no higher than the knuckles pass over."""
    return _PASSED_OVER_m if motion.tallest_m is None else motion.tallest_m
