"""Grasps from the side, palm upright, of what is too tall for the palm to pass over.

The object is known storey by storey, felt before the first grasp and fitted again to all contacts after each. The hand
closes across a side of it, at any height the arm reaches, as deep behind its front as everything is clear; of those
grasps comes next the one whose contacts are expected farthest from all that was touched. The object is left where it
stands. Poses chosen by chance close before a rounded body or slip off a neck; with this rule 30 of 30 tries on seven
scanned objects put on at least three fingertips (decision 45).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from drivers.core.contacts import Array
from drivers.shadow.closing.closing import SIDES, closing, sideways
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan, TouchPlace
from sessions.motion.probing.touch_patterns import lowest_touch_m
from tactile_lab.autonomy.standing.candidate import ActionPlanner, StandingCandidate, approach_of
from tactile_lab.autonomy.standing.side_clearance import expected_closing, is_way_clear
from tactile_lab.autonomy.standing.storeys import Storeys

_MARGIN_m = 0.003
"""Of the box that the hand keeps out of, beyond what was touched."""

_SURELY_m, _BELOW_TOP_m = 0.012, 0.012
"""A fingertip counts that meets a box so much smaller on its sides and at its top, with its centre inside the edges. On
an edge itself a contact's normal belongs to neither face."""

_HEIGHT_STEP_m, _DEPTH_STEP_m, _DEEPEST_m, _SHALLOWEST_m = 0.02, 0.005, 0.05, 0.005
_SHALLOWER_m = 0.010
"""So much less deep the hand comes where it was blocked."""

_LOW_FIRST = 0.1
"""Metres of novelty that a metre of height costs: low touches do not tip the object."""

_FRICTION = 0.5
"""Of the table and the foot, at most: a push higher than half the width by this tips an object before it slides."""

_ASKEW_rad = np.radians(15.0)
"""A side that the arm cannot turn to squarely is held so much from aside: fingertips do not slip yet."""

_ROW_m = 0.07
"""Height of the row of fingertips in a touch from the side."""


def slides_up_to_m(foot_m: float) -> float:
    """How high an object whose foot reaches so far from its middle may be pushed: it slides then, and does not tip."""
    return foot_m / _FRICTION


@dataclass
class SidePlanner(ActionPlanner):
    """Plans grasps from the side around one object.

    Attributes:
        lowest_m: height of the lowest fingertip with the first finger down, and up.
    """

    lowest_m: tuple[float, float]

    def best(self) -> StandingCandidate | None:
        """The next grasp; None where nothing is left that would tell anything new."""
        rated = [one for one in self._candidates() if self.felt.are_new(one.touches_m).any()]
        if not rated:
            return None
        best = max(rated, key=lambda one: one.score_m)
        near = self._near_side(best.plan)
        reason = f"{len(best.touches)} contacts expected at {self._spread(best.touches_m)}"
        reason += ", its near side touched first" if near else ""
        return replace(best, plan=replace(best.plan, tap=near is not None, places=near or (), reason=reason))

    def _candidates(self) -> Iterator[StandingCandidate]:
        """The deepest clear grasp across each side of the box, from both sides of the arm, at each height."""
        felt, top_m = self.felt.storeys, self.felt.standing_box.size_m[2]
        solid, surely = felt.grow(_MARGIN_m, 0.0), felt.grow(-_SURELY_m, -_BELOW_TOP_m)
        for yaw_rad in self.felt.yaws(self.yaw_window_rad, _ASKEW_rad):
            for side in SIDES:
                name, lowest_m = sideways("pinch", side), lowest_touch_m(side, self.lowest_m, self.hand)
                for height_m in np.arange(lowest_m, max(top_m - _BELOW_TOP_m, lowest_m), _HEIGHT_STEP_m):
                    if found := self._deepest(name, yaw_rad, float(height_m), solid, surely):
                        yield found

    def _deepest(
        self, name: str, yaw_rad: float, height_m: float, solid: Storeys, surely: Storeys
    ) -> StandingCandidate | None:
        approach = np.array(closing(name, height_m, self.hand).approach[:2])
        c, s = np.cos(yaw_rad), np.sin(yaw_rad)
        way = np.array([[c, -s], [s, c]]) @ approach
        is_gentle = self.felt.is_unsteady(np.array([c, s]))
        if self.felt.is_unsteady(way) and not is_gentle:
            return None
        foot, held = solid.boxes[0], solid.at(height_m + _ROW_m / 2)
        deepest_m = _DEEPEST_m + held.front_m(way) - foot.front_m(way)
        for depth_m in np.arange(deepest_m, _SHALLOWEST_m - 1e-9, -_DEPTH_STEP_m):
            x, y = held.centre_m + (foot.front_m(way) + depth_m - held.centre_m @ way) * way
            plan = GraspPlan(GraspFrame(float(x), float(y), yaw_rad), name, height_m, is_gentle=is_gentle)
            if self._was_blocked(plan, float(depth_m)) or not self.reach.holds(plan, self.hand):
                continue
            if is_way_clear(plan, self.hand, solid) and (one := self._closing(plan, float(depth_m), solid, surely)):
                return one
        return None

    def _closing(self, plan: GraspPlan, depth_m: float, solid: Storeys, surely: Storeys) -> StandingCandidate | None:
        """The grasp with the fingers that would meet the object; None where they do not hold it."""
        expected = expected_closing(plan, self.hand, solid, surely)
        if not expected.holds:
            return None
        score_m = self.felt.novelty_m(np.array(list(expected.touches.values()))) - _LOW_FIRST * plan.height_m
        return StandingCandidate(replace(plan, stays_open=expected.stays_open), expected.touches, score_m, depth_m)

    def _was_blocked(self, plan: GraspPlan, depth_m: float) -> bool:
        """Whether the hand met something on nearly the same way, less than a little deeper."""
        return any(
            plan.closing == other.plan.closing
            and abs(plan.height_m - other.plan.height_m) < _HEIGHT_STEP_m / 2
            and abs(np.sin((plan.frame.yaw_rad - other.plan.frame.yaw_rad) / 2)) < 0.1
            and depth_m > other.depth_m - _SHALLOWER_m
            for other in self.blocked
        )

    def _near_side(self, plan: GraspPlan) -> tuple[TouchPlace] | None:
        """A touch of the side that the hand comes from; None where it tells nothing new, or tips the object over."""
        box, way = self.felt.standing_box, approach_of(plan, self.hand)
        heights_m = np.arange(plan.height_m, min(plan.height_m + _ROW_m, box.size_m[2]), _ROW_m / 3)
        met = self.felt.storeys.at(plan.height_m)
        front = met.centre_m - met.half_along_m(way) * way
        places_m = np.array([[*front, height_m] for height_m in heights_m])
        steady_m = slides_up_to_m(box.foot_along_m(way))
        if heights_m.mean() >= steady_m or not self.felt.is_unknown(places_m):
            return None
        return (TouchPlace(plan.frame, plan.height_m, min(steady_m, box.size_m[2])),)

    @staticmethod
    def _spread(touches_m: Array) -> str:
        low, high = 1e3 * touches_m[:, 2].min(), 1e3 * touches_m[:, 2].max()
        return f"{low:.0f} to {high:.0f} mm"
