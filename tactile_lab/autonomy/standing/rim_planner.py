"""Pinches over the rim of what is wider than the hand opens, from above: fingers outside, the thumb inside.

A bowl blocks every hand that comes down around its middle, and yet has a wall that the hand can hold. Whether an object
is hollow is not known before: on a solid one the thumb lands on the top, and after two tries no other is made.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from drivers.shadow.closing.closing import LOWEST_m, closing
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from tactile_lab.autonomy.standing.candidate import ActionPlanner, StandingCandidate

_CLOSING = "pinch"
_BELOW_RIM_m, _HIGHEST_m = 0.018, 0.08
"""From the rim down to the fingertips; over higher rims the knuckles do not pass."""

_YAWS_APART_rad = np.radians(30.0)
_WALL_m = 0.003
"""Assumed half thickness of the wall."""

_TRIES = 2


@dataclass
class RimPlanner(ActionPlanner):
    """Plans pinches over the rim of one object."""

    _is_wide: bool = False
    """It was felt once that the hand does not open as wide."""

    def best(self) -> StandingCandidate | None:
        """The next pinch; None where none would tell anything new, or the hand spans the object."""
        size_m = self.felt.standing_box.size_m
        self._is_wide |= self.felt.is_wide
        if len(self.blocked) >= _TRIES or size_m[2] > _HIGHEST_m or not self._is_wide:
            return None
        tried = [one.plan.frame.yaw_rad for one in self.blocked]
        new = (one for one in self._candidates() if self.felt.are_new(one.touches_m).any())
        rated = [one for one in new if all(abs(one.plan.frame.yaw_rad - yaw) > _YAWS_APART_rad / 2 for yaw in tried)]
        return max(rated, key=lambda one: one.score_m, default=None)

    def _candidates(self) -> Iterator[StandingCandidate]:
        low, high = self.yaw_window_rad
        steps = int(min(-low, high) // _YAWS_APART_rad)
        around = [step * _YAWS_APART_rad for step in range(-steps, steps + 1)]
        for yaw_rad in around if self.felt.is_round else self.felt.yaws(self.yaw_window_rad):
            plan = self._over_rim(float(yaw_rad))
            if self.reach.holds(plan, self.hand):
                yield self._expecting(plan)

    def _over_rim(self, yaw_rad: float) -> GraspPlan:
        """With the rim in the middle between thumb and fingers, which are outside."""
        box, outward = self.felt.standing_box, np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
        half_m = sum(box.size_m[:2]) / 4 if self.felt.is_round else box.half_along_m(outward)
        x, y = self.felt.middle_m + (half_m - _WALL_m) * outward
        height_m = max(LOWEST_m, box.size_m[2] - _BELOW_RIM_m)
        reason = "a pinch over the rim, the thumb inside"
        return GraspPlan(GraspFrame(float(x), float(y), yaw_rad), _CLOSING, float(height_m), reason, may_shift=False)

    def _expecting(self, plan: GraspPlan) -> StandingCandidate:
        table, touches = closing(plan.closing, plan.height_m, self.hand), {}
        for finger in table.fingers:
            place = table.path(finger).centre_m(table.path(finger).valid[0])
            place[0] = _WALL_m * np.sign(place[0])
            touches[finger] = np.asarray(plan.frame.pose.transformFrom(place))
        return StandingCandidate(plan, touches, self.felt.novelty_m(np.array(list(touches.values()))))
