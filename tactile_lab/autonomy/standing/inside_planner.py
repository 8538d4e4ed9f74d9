"""Touches inside what is open from above: one finger goes down between walls that were felt around it.

Taps tell where nothing is below the top. Walls all around tell an opening from a notch. What the hand knows of outsides
says nothing of the inside, however thin the wall between them, so what would be new is judged by where contacts face.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array
from drivers.core.poses import transform_points
from drivers.shadow.closing.finger_down import FINGER, LEANS_rad, finger_down
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan, Opening
from sessions.motion.probing.touch_patterns import TAP, TAP_HEIGHT_m
from tactile_lab.autonomy.standing.candidate import ActionPlanner, StandingCandidate

_ROOM_m = 0.022
"""From the middle of an opening to what is around it: a fingertip, how far aside it goes down, and the wall."""

_OVER_RIM_m, _OVER_TABLE_m = 0.005, 0.004
"""All else of the hand stays so far above the rim, and the fingertip above the table."""

_FLOOR_m = 0.010
"""A floor is expected so high above the table."""

_STOREYS_m = (0.012, 0.037)
"""Walls are touched so far above where the finger gets to."""

_YAWS_APART_rad = np.radians(30.0)
_LEAST_NEWS_m = 0.06
"""Of all contacts together; else a touch inside tells nothing new."""

_TRIES = 2


@dataclass
class InsidePlanner(ActionPlanner):
    """Plans touches inside one object."""

    def best(self) -> StandingCandidate | None:
        """The next touch; None where nothing is open, or none would tell anything new."""
        if FINGER not in self.hand.form.fingers or len(self.blocked) >= _TRIES:
            return None
        if (found := self.felt.opening()) is None or found[1] < _ROOM_m:
            return None
        rated = [one for one in self._candidates(*found) if self.reach.holds(one.plan, self.hand)]
        best = max(rated, key=lambda one: one.score_m, default=None)
        return best if best is not None and best.score_m > _LEAST_NEWS_m else None

    def _candidates(self, middle_m: Array, half_m: float) -> Iterator[StandingCandidate]:
        """One at each yaw of the hand."""
        low, high = self.yaw_window_rad
        rim_m = self.felt.standing_box.size_m[2]
        room_m = min(finger_down(lean_rad, self.hand).room_m(2 * half_m) for lean_rad in LEANS_rad)
        opening = Opening(half_m, rim_m, max(_OVER_TABLE_m, rim_m - room_m + _OVER_RIM_m))
        steps = np.arange(np.ceil(low / _YAWS_APART_rad), np.floor(high / _YAWS_APART_rad) + 1)
        for yaw_rad in steps * _YAWS_APART_rad:
            frame = GraspFrame(float(middle_m[0]), float(middle_m[1]), float(yaw_rad))
            places_m, normals = _expected(frame, opening)
            reason = f"one finger inside: {len(places_m)} contacts expected"
            plan = GraspPlan(frame, TAP.closing, TAP_HEIGHT_m, reason, only_touch=True, opening=opening)
            news_m = float(self.felt.inside_distances_m(places_m, normals).sum())
            yield StandingCandidate(plan, {FINGER: places_m[0]}, news_m, further_m=places_m[1:], normals=normals)


def _expected(frame: GraspFrame, opening: Opening) -> tuple[Array, Array]:
    """Where contacts are expected on floor and walls, and outward normals there, shape (n, 3) each, world frame."""
    lowest_m = max(opening.deepest_m, _FLOOR_m)
    places_m, normals = [[0.0, 0.0, lowest_m]], [[0.0, 0.0, 1.0]]
    for lean_rad in LEANS_rad:
        ahead = float(np.sign(lean_rad))
        places_m += [[ahead * opening.half_m, 0.0, min(lowest_m + up_m, opening.rim_m)] for up_m in _STOREYS_m]
        normals += [[-ahead, 0.0, 0.0]] * len(_STOREYS_m)
    return transform_points(frame.pose, np.array(places_m)), np.array(normals) @ frame.pose.rotation().matrix().T
