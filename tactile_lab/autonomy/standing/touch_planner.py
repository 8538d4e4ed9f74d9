"""Touches without a grasp: taps beside one another on the top, single sides at any height and place.

They reach what no closing spans: sides wider apart than the hand opens, a wide top, what lies too low or too near
something for the palm. One touch tells less than a grasp, and pushes from one side, so only as high as the object
would rather slide than tip.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from drivers.core.contacts import Array
from drivers.shadow.closing.closing import SIDES, closing, sideways
from sessions.motion.cycle_settings import TouchSettings
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.probing.side_survey import LOW_m
from sessions.motion.probing.touch_patterns import COLUMN, TAP, TAP_HEIGHT_m, lowest_touch_m
from tactile_lab.autonomy.standing.candidate import ActionPlanner, StandingCandidate, approach_of
from tactile_lab.autonomy.standing.side_clearance import StandingBox
from tactile_lab.autonomy.standing.side_planner import slides

_TAPS_APART_m, _LANES_APART_m, _HEIGHTS_APART_m = 0.04, 0.025, 0.025
_INSIDE_m = 0.008
"""From the edges of a face to the places where it is touched."""

_ASKEW_rad = np.radians(20.0)
"""A side that the arm cannot turn to squarely is touched so much from aside: fingertips do not slip yet."""

_SQUARELY = 0.7
"""Of the half width of what is round: farther aside a finger passes beside it, and a link meets it."""

_FINGERS_APART_m = 0.023
"""In a hand whose palm is upright."""


@dataclass
class TouchPlanner(ActionPlanner):
    """Plans touches of one object.

    Attributes:
        settings: of touches.
    """

    settings: TouchSettings = field(default_factory=TouchSettings)

    def best(self) -> StandingCandidate | None:
        """The next touch; None where nothing is left that would tell anything new."""
        new = (one for one in (*self._taps(), *self._sides()) if self.felt.is_new(one.touches_m))
        rated = [one for one in new if not self._was_blocked(one.plan) and self.reach.holds(one.plan, self.hand)]
        return max(rated, key=lambda one: one.score_m, default=None)

    def _was_blocked(self, plan: GraspPlan) -> bool:
        """Whether the hand met something on its way to nearly the same touch."""
        return any(
            plan.closing == other.plan.closing
            and abs(plan.height_m - other.plan.height_m) < _HEIGHTS_APART_m / 2
            and np.hypot(plan.frame.x_m - other.plan.frame.x_m, plan.frame.y_m - other.plan.frame.y_m) < _LANES_APART_m
            for other in self.blocked
        )

    def _candidate(
        self, frame: GraspFrame, name: str, height_m: float, touches: dict[str, Array], what: str
    ) -> StandingCandidate:
        plan = GraspPlan(frame, name, height_m, f"{what}: {len(touches)} contacts expected", only_touch=True)
        return StandingCandidate(plan, touches, self.felt.novelty_m(np.array(list(touches.values()))))

    # --- from above ----------------------------------------------------------------------------------------------

    def _taps(self) -> Iterator[StandingCandidate]:
        """Side by side over the top."""
        box, yaw = self.felt.standing_box, float(np.mean(self.yaw_window_rad))
        for along_m in _places(box.size_m[0] / 2, _TAPS_APART_m):
            for across_m in _places(box.size_m[1] / 2, _TAPS_APART_m):
                x, y = _at(box, along_m, across_m)
                frame = GraspFrame(x, y, yaw)
                if touches := self._tapped(frame, box):
                    yield self._candidate(frame, TAP.closing, TAP_HEIGHT_m, touches, "tap on the top")

    def _tapped(self, frame: GraspFrame, box: StandingBox) -> dict[str, Array]:
        """Where fingertips meet the top, by finger."""
        table, shrunk = closing(TAP.closing, TAP_HEIGHT_m, self.hand), box.grow(-_INSIDE_m / 2, 0.0)
        found = {}
        for finger in table.fingers:
            place = np.asarray(frame.pose.transformFrom(table.path(finger).centre_m(TAP.progress[finger])))
            place[2] = box.size_m[2]
            if shrunk.distances_m(place) <= 1e-9:
                found[finger] = place
        return found

    # --- from the side -------------------------------------------------------------------------------------------

    def _sides(self) -> Iterator[StandingCandidate]:
        """Every side that the arm can come to, in lanes, at heights where the object is not tipped over."""
        for yaw_rad in self.felt.yaws(self.yaw_window_rad, _ASKEW_rad):
            for side in SIDES:
                lowest_m = lowest_touch_m(side, self.settings.side_heights_m, self.hand)
                yield from self._on_side(yaw_rad, sideways(COLUMN.closing, side), lowest_m)

    def _on_side(self, yaw_rad: float, name: str, lowest_m: float) -> Iterator[StandingCandidate]:
        box, across = self.felt.standing_box, np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
        way = approach_of(GraspPlan(GraspFrame(0.0, 0.0, yaw_rad), name, lowest_m), self.hand)
        half_m, wide_m = box.half_along_m(way), box.half_along_m(across)
        for lane_m in _places(_SQUARELY * wide_m if self.felt.is_round else wide_m, _LANES_APART_m):
            lane = np.array([box.x_m, box.y_m]) + lane_m * across
            if box.distances_m(np.array([*lane, box.size_m[2] / 2])) > -_INSIDE_m:
                continue
            front = lane - box.way_out_m(lane, -way) * way
            frame = GraspFrame(float(front[0]), float(front[1]), yaw_rad)
            for height_m in np.arange(lowest_m, max(box.size_m[2] - _INSIDE_m, lowest_m + 1e-9), _HEIGHTS_APART_m):
                touches = _touched(front, float(height_m), box.size_m[2], self.hand.form.long_fingers)
                if slides(max(float(place[2]) for place in touches.values()), half_m):
                    yield self._candidate(frame, name, float(height_m), touches, "one side touched")


def _touched(front_m: Array, height_m: float, top_m: float, fingers: Sequence[str]) -> dict[str, Array]:
    """Where fingertips one above the other meet a side: all that are low; else the lowest, which is ahead."""
    heights_m = height_m + _FINGERS_APART_m * np.arange(len(fingers))
    met_m = heights_m[heights_m < min(LOW_m, top_m)]
    if not len(met_m):
        met_m = heights_m[:1]
    return {finger: np.array([*front_m, z]) for finger, z in zip(fingers, met_m, strict=False)}


def _places(half_m: float, apart_m: float) -> Array:
    """Evenly spread from the middle, as far as a face reaches from there."""
    count = int(max(0.0, half_m - _INSIDE_m) // apart_m)
    return np.asarray(apart_m * np.arange(-count, count + 1))


def _at(box: StandingBox, along_m: float, across_m: float) -> tuple[float, float]:
    """A place given along the box's own axes, world x, y."""
    c, s = np.cos(box.yaw_rad), np.sin(box.yaw_rad)
    return float(box.x_m + c * along_m - s * across_m), float(box.y_m + s * along_m + c * across_m)
