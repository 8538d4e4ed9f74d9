"""Touches with one finger that hangs down: a small top, and the inside of what is open from above, where it goes down
between the walls, to the floor and against them.
"""

from __future__ import annotations

from collections.abc import Sequence

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

_BELOW_TOP_m = 0.003
"""What is met from there on is a slope or a rim, on which links land."""

_BELOW_RIM_m = 0.010
"""Higher up a fingertip meets the rim."""

_SUNK_m = 0.002
"""The hand goes on so far until the fingertip is pressed."""

_DOWN = np.array([0.0, 0.0, -1.0])


class OneFingerToucher(Toucher):
    """Touches with one finger, too."""

    def touch_top(self, frame: GraspFrame, deepest_m: float) -> None:
        """Come down on a top that has no room for more fingers.

        Args:
            frame: the finger goes down in its origin.
            deepest_m: no lower than that.
        """
        posture = finger_down(LEANS_rad[0], self._hand)
        self._lower_finger(frame, top_at_most_m(self._motion), deepest_m, posture)
        self._go_up(frame, posture)

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
        if self._lower_finger(frame, opening.rim_m, opening.deepest_m, posture):
            self._touch_walls(frame, opening, posture)
        self._go_up(frame, posture)

    def _lower_finger(self, frame: GraspFrame, top_m: float, deepest_m: float, posture: FingerDown) -> bool:
        """Over an object, and down as in a tap: the slower the nearer, below its top as slowly as where links may land.
        Returns whether the finger may go on.
        """
        motion, cycle, s = self._motion, self._cycle, self.settings
        above = self._above(frame, posture)
        motion.climb(above, cycle.travel_m_s)
        motion.blend_fingers(posture.table, _held(posture).progress, cycle.finger_rad_s)
        motion.move_base(motion.unwound(above), *self._travel)
        motion.tare(cycle.rest_s)
        heights_m = [max(deepest_m, height_m) for height_m in (top_m + s.near_m, top_m - _BELOW_TOP_m, deepest_m)]
        speeds_m_s = (cycle.descent_m_s, s.tap_m_s, cycle.links_landing_m_s)
        goals = [motion.base_joints(frame, posture.table, height_m) for height_m in heights_m]
        return self._go(list(zip(goals, speeds_m_s, strict=True)), posture, frame)

    def _go_up(self, frame: GraspFrame, posture: FingerDown) -> None:
        self._motion.climb(self._above(frame, posture), self._cycle.travel_m_s)

    def _above(self, frame: GraspFrame, posture: FingerDown) -> Array:
        """Where the hand may travel, the fingertip over the frame's origin."""
        above_m = top_at_most_m(self._motion) + self._cycle.clearance_m
        return self._motion.base_joints(frame, posture.table, above_m)

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
            is_free = self._go([(goal, self.settings.side_m_s)], posture, frame, along)
            motion.move_base(middle, *self._travel)
            if not is_free:
                return

    def _go(
        self, ways: Sequence[tuple[Array, float]], posture: FingerDown, frame: GraspFrame, along: Array = _DOWN
    ) -> bool:
        """To one goal after another, each at a speed of its own, until something is met, and the fingertip against it
        along a direction in the grasp frame. Returns whether the finger may go on: no link has met anything.
        """
        self._motion.runtime.begin_closing()
        met = any(self._approach(goal, speed_m_s) for goal, speed_m_s in ways)
        if (is_free := LINKS not in self.guard.met) and met:
            table, held = posture.table, _held(posture)
            self._lay_on(table, held, along, frame, self.settings.alone_N, _SUNK_m, up_to_m=0.0)
        self.capture()
        return is_free


def _held(posture: FingerDown) -> Pattern:
    """All fingers as they are in the posture."""
    return Pattern(posture.table.name, dict.fromkeys(posture.table.fingers, 0.0))
