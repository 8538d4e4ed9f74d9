"""Touches inside what is open from above: one finger goes down between its walls, to its floor and against them."""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array
from drivers.shadow.closing.finger_down import FINGER, FingerDown, LEANS_rad, finger_down
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import Opening
from sessions.motion.guard import LINKS
from sessions.motion.probing.touch_patterns import Pattern
from sessions.motion.probing.touching import Toucher
from sessions.motion.travel import top_at_most_m

_OFF_FLOOR_m, _STOREY_m, _WALLS = 0.008, 0.025, 2
"""A wall is touched so far above the lowest place that the finger got to, and again so much higher."""

_BEHIND_WALL_m = 0.015
"""A wall is looked for so far beyond where it is expected."""

_OVER_RIM_m = 0.004
"""From there on the finger goes down slowly."""

_BELOW_RIM_m = 0.010
"""Higher up a fingertip meets the rim."""

_SUNK_m = 0.002
"""The hand goes on so far until the fingertip is pressed."""

_DOWN = np.array([0.0, 0.0, -1.0])


class InsideToucher(Toucher):
    """Touches the inside of an object, too."""

    def touch_inside(self, frame: GraspFrame, opening: Opening) -> None:
        """Go down in an opening until the floor is met, if it is no deeper than the finger gets, then against the wall
        at some heights; once with the finger leaning to each side.

        Args:
            frame: the finger goes down in its origin, and to the walls along its x axis.
            opening: around it.
        """
        aside_m = (opening.rim_m - opening.deepest_m) / 2 * np.tan(LEANS_rad)
        for lean_rad, ahead_m in zip(LEANS_rad, aside_m, strict=True):
            middle = frame.shifted_inside(np.array([ahead_m, 0.0]))  # of the finger that leans, as far as it goes in
            self._reach_in(middle, opening, finger_down(lean_rad, self._hand))

    def _reach_in(self, frame: GraspFrame, opening: Opening, posture: FingerDown) -> None:
        """Down, and against one wall; up at once where a link has met something."""
        motion, cycle, table = self._motion, self._cycle, posture.table
        above = motion.base_joints(frame, table, top_at_most_m(motion) + cycle.clearance_m)
        near = motion.base_joints(frame, table, opening.rim_m + _OVER_RIM_m)
        lowest = motion.base_joints(frame, table, opening.deepest_m)
        motion.climb(above, cycle.travel_m_s)
        motion.blend_fingers(table, _held(posture).progress, cycle.finger_rad_s)
        motion.move_base(motion.unwound(above), *self._travel)
        motion.tare(cycle.rest_s)
        if not self._approach(near, cycle.descent_m_s) and self._goes_to(
            lowest, cycle.links_landing_m_s, posture, frame
        ):
            self._touch_walls(frame, opening, posture)
        motion.climb(above, cycle.travel_m_s)

    def _touch_walls(self, frame: GraspFrame, opening: Opening, posture: FingerDown) -> None:
        """The wall that the finger leans to, at some heights from the lowest that it got to."""
        motion, along = self._motion, posture.ahead
        there = frame.shifted_inside((opening.half_m + _BEHIND_WALL_m) * along[:2])
        lowest_m = float(motion.tip_centre_world_m(FINGER, self._hand)[2] - posture.tip_m[2]) + _OFF_FLOOR_m
        for height_m in lowest_m + _STOREY_m * np.arange(_WALLS):
            if height_m > opening.rim_m - _BELOW_RIM_m:
                return
            middle = motion.base_joints(frame, posture.table, height_m)
            motion.move_base(middle, *self._travel)
            goal = motion.base_joints(there, posture.table, height_m)
            is_free = self._goes_to(goal, self.settings.side_m_s, posture, frame, along)
            motion.move_base(middle, *self._travel)
            if not is_free:
                return

    def _goes_to(
        self, goal: Array, speed_m_s: float, posture: FingerDown, frame: GraspFrame, along: Array = _DOWN
    ) -> bool:
        """Toward a goal until something is met, and the fingertip against it along a direction in the grasp frame.
        Returns whether the finger may go on: no link has met anything.
        """
        self._motion.runtime.begin_closing()
        met = self._approach(goal, speed_m_s)
        if (is_free := LINKS not in self.guard.met) and met:
            table, held = posture.table, _held(posture)
            self._lay_on(table, held, along, frame, self.settings.alone_N, _SUNK_m, up_to_m=0.0)
        self.capture()
        return is_free


def _held(posture: FingerDown) -> Pattern:
    """All fingers as they are in the posture."""
    return Pattern(posture.table.name, dict.fromkeys(posture.table.fingers, 0.0))
