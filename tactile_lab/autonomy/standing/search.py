"""Looking for an object that may have fallen over or been pushed: when, where, and what has become of it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from drivers.core.contacts import Array, Grasp
from sessions.conductor.estimator import Change, Search
from sessions.motion.probing.bounding_box import BoundingBox
from tactile_lab.autonomy.standing.candidate import StandingCandidate
from tactile_lab.autonomy.standing.felt_object import FeltObject

_ASTRAY = 2
"""Grasps in a row whose contacts fit nothing: the object does not stand where it stood."""

_BLOCKED = 3
"""Approaches in a row: something stands where nothing was felt."""

_SEARCHES = 4
"""In a session, but for those that met its top at once: what falls again and again has to be steadied."""

_LIES_AT = (0.35, 0.6)
"""From its foot to where an object that fell is tapped on, in shares of its height."""

_RINGS_m, _WAYS = (0.06, 0.11), 8
_FALLEN_m, _MOVED_m = 0.010, 0.006
"""A top so much lower or higher is another one; a middle so far away means that the object was moved."""


@dataclass
class Whereabouts:
    """Whether an object is still where it was.

    Attributes:
        felt: what is known of the object.
    """

    felt: FeltObject
    searches: int = 0
    _reason: str = ""
    _from_top: bool = True
    _only_top_met: bool = False
    _way: Array = field(default_factory=lambda: np.zeros(2))
    _met_little: bool = False
    _astray: int = 0
    _blocked: int = 0

    def on_grasp(self, grasp: Grasp, done: StandingCandidate, way: Array) -> None:
        """Note what a grasp or touch has met.

        Args:
            grasp: as measured.
            done: what was expected of it.
            way: direction in which the hand came, world x, y.
        """
        self._blocked = 0
        self._met_little = not done.plan.only_touch and len(grasp.touching) < len(done.touches) / 2
        self._only_top_met &= not grasp.contacts
        if not grasp.contacts:
            what = "touch" if done.plan.only_touch else "grasp"
            self._reason = f"{what} {grasp.index + 1} met nothing where {len(done.touches)} contacts were expected"
            self._from_top, self._way = not self._only_top_met, way

    def on_blocked(self) -> None:
        """Note that the hand met something on its way to where nothing should be."""
        self._blocked += 1
        if self._blocked == _BLOCKED:
            self._reason = f"{self._blocked} approaches in a row were blocked"
            self._from_top, self._way = False, np.zeros(2)

    def on_estimate(self, is_placed: bool) -> None:
        """Note whether the contacts of the last grasp fit what was felt before."""
        self._astray = 0 if is_placed else self._astray + self._met_little
        self._met_little = False
        if self._astray >= _ASTRAY and not self._reason:
            self._reason = f"{self._astray} grasps in a row met less than half of what was expected, and fit nothing"
            self._from_top, self._way, self._astray = False, np.zeros(2), 0

    @property
    def is_given_up(self) -> bool:
        """Whether it was looked for too often already."""
        return bool(self._reason) and self.searches >= _SEARCHES

    def search(self) -> Search | None:
        """How to look for the object; None where nothing says that it has moved."""
        if not self._reason or self.is_given_up:
            return None
        height_m = self.felt.box.top_m or 0.0
        foot_m, first_m = self.felt.middle_m, self.felt.top_place_m
        fallen_m = [foot_m + share * height_m * self._way for share in _LIES_AT] if self._way.any() else []
        ways = [np.array([np.cos(a), np.sin(a)]) for a in 2 * np.pi * np.arange(_WAYS) / _WAYS]
        around_m = [foot_m + radius_m * way for radius_m in _RINGS_m for way in ways]
        return Search(self._reason, np.array([first_m, *fallen_m, *around_m]), height_m if self._from_top else None)

    def judge(self, box: BoundingBox) -> Change:
        """What has become of the object, now felt as ``box``."""
        change, self._reason = self._change(box), ""
        self._only_top_met = change is Change.STANDS and not box.has_sides
        self.searches += not self._only_top_met
        return change

    def _change(self, box: BoundingBox) -> Change:
        """What was touched before at the same place and height stands there: a tap beside a rim slips into a bowl."""
        was, top_m = self.felt.box, box.top_m or 0.0
        if not box.has_sides and self.felt.was_touched(np.append(box.centre_world_m, top_m)):
            return Change.STANDS
        if abs(top_m - (was.top_m or 0.0)) > max(_FALLEN_m, 0.1 * (was.top_m or 0.0)):
            return Change.FELL
        if not box.has_sides or np.linalg.norm(box.centre_world_m - was.centre_world_m) < _MOVED_m:
            return Change.STANDS
        return Change.MOVED

    def in_words(self, change: Change, box: BoundingBox, grasps: int) -> str:
        """What has become of the object, for people; after so many grasps and touches."""
        if change is Change.STANDS:
            return f"the object {change}"
        after = f"the object {change} after grasp {grasps}"
        if change is Change.MOVED:
            away_mm = 1e3 * float(np.linalg.norm(box.centre_world_m - self.felt.middle_m))
            return f"{after}, by {away_mm:.0f} mm; the session goes on where it stands now"
        tops_mm = 1e3 * (box.top_m or 0.0), 1e3 * (self.felt.box.top_m or 0.0)
        x_mm, y_mm = 1e3 * box.centre_world_m
        return (
            f"{after}: it is {tops_mm[0]:.0f} mm high at ({x_mm:.0f}, {y_mm:.0f}) mm instead of {tops_mm[1]:.0f} mm. "
            "The session goes on with it as it lies now, and forgets what it had felt before"
        )
