"""Touches of what the palm passes over, for its bounding box: fingers in a row, or the thumb."""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array
from drivers.shadow.closing.closing import closing
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.probing.touch_patterns import ROW, Pattern
from sessions.motion.probing.touching import Toucher

_BACK = np.array([-1.0, 0.0, 0.0])


class Raker(Toucher):
    """Touches the sides of low objects, too."""

    @property
    def first_finger_side(self) -> float:
        """1 where the first finger is toward +y of the grasp frame, -1 on a left hand."""
        return -1.0 if self._hand.form.is_left else 1.0

    def rake(self, frame: GraspFrame, from_m: float) -> Array | None:
        """Come toward the middle of a grasp frame from its +x side, fingers in a row, until they touch something.

        Args:
            frame: fingers move along its -x axis, over its origin and as far beyond.
            from_m: their start, relative to its origin.

        Returns:
            Where fingertips touched something, shape (n, 3), world frame; None if they could not descend.
        """
        s, motion = self.settings, self._motion
        table = closing(ROW.closing, s.rake_height_m, self._hand)
        begin, end = (frame.shifted_inside(np.array([x - s.row_m, 0.0])) for x in (from_m, -s.beyond_m))
        self._poise(table, ROW, begin)
        self.guard.restart()
        if not motion.probe_base(motion.base_joints(begin, table), self._cycle.descent_m_s, self.guard.is_met):
            self._rise()
            return None
        motion.wait(self._cycle.rest_s)
        motion.runtime.begin_closing()
        found = np.empty((0, 3))
        if self._approach(motion.base_joints(end, table), s.rake_m_s):
            self._lay_on(table, ROW, _BACK, frame, s.rake_N, 0.0)
            found = self._landing_points(_BACK, frame)
            self.capture()
            motion.move_base(motion.base_joints(begin, table), *self._travel)
        self._rise()
        return found

    def close_thumb(self, frame: GraspFrame) -> Array | None:
        """Come down around a grasp frame, the hand open, and close only the thumb.

        Returns:
            Where the thumb touched something, or landed on it on the way down, shape (n, 3), world frame; None if
            another finger could not descend.
        """
        s, motion = self.settings, self._motion
        table = closing(ROW.closing, s.rake_height_m, self._hand)
        progress = {finger: table.path(finger).valid[0] for finger in table.fingers}
        self._poise(table, Pattern(ROW.closing, progress), frame)
        self.guard.restart()
        if not motion.probe_base(motion.base_joints(frame, table), self._cycle.descent_m_s, self.guard.is_met):
            stands = "TH" in self.guard.met
            met_m = motion.tip_centre_world_m("TH", self._hand)
            self._rise()
            return met_m[None] if stands else None
        motion.wait(self._cycle.rest_s)
        motion.runtime.begin_closing()
        path, found = table.path("TH"), np.empty((0, 3))
        while progress["TH"] < path.valid[1] and self._motion.loads_N().get("TH", 0.0) <= s.met_N:
            progress["TH"] += self._cycle.closing_m_s * motion.cycle_s / path.length_m
            motion.set_fingers(table, progress)
            motion.tick()
        if self._motion.loads_N().get("TH", 0.0) > s.met_N:
            motion.wait(self._cycle.rest_s)
            found = self._landing_points(path.direction, frame)
            self.capture()
        progress["TH"] = path.valid[0]
        motion.blend_fingers(table, progress, self._cycle.finger_rad_s)
        self._rise()
        return found

    def _rise(self) -> None:
        """Move straight up from the positioner's last target."""
        self._motion.rise(self._cycle.lift_m, self._cycle.travel_m_s)
