"""What is too tall for the palm to pass over is felt from its sides: four touches, palm upright, low down.

The top is known by then. A touch comes from the left and the right of the arm's middle yaw, and from before and behind
as nearly as the arm's yaw window allows; the normals of the contacts show the object's heading.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from drivers.core.contacts import Array
from drivers.shadow.closing.closing import SIDES
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import TouchPlace
from sessions.motion.probing.bounding_box import BoundingBox
from sessions.motion.probing.box_fit import fit_box, on_sides
from sessions.motion.probing.touching import SideTouch, Toucher

_ASSUMED_m = 0.030
"""From the middle to a side that was not found."""

_ASKEW_m = 0.008
"""Left and right are felt again where the middle turns out to be farther from where they were felt."""

_LOW_m = 0.045
"""Fingertips up to this height are laid on together: how wide the object is, is not known yet."""

_AGAIN_m = 0.05
"""So much farther out the hand comes down once more where something stood in its way."""


class SideSurvey:
    """Feels the sides of a tall object.

    Args:
        toucher: the hand's way of touching.
        yaw_window_rad: of the arm.
        search_m: how far from the middle a touch begins.
        lanes_m: offsets across the touch; the next is tried where nothing was met.
        margin_m: to keep besides what was felt.
    """

    def __init__(
        self,
        toucher: Toucher,
        yaw_window_rad: tuple[float, float],
        search_m: float,
        lanes_m: tuple[float, ...],
        margin_m: float,
    ) -> None:
        self._toucher, self._window_rad = toucher, yaw_window_rad
        self._search_m, self._lanes_m, self._margin_m = search_m, lanes_m, margin_m

    def feel(self, centre_m: Array, top_m: float, stop: Callable[[], bool] = lambda: False) -> BoundingBox:
        """The sides of what stands around ``centre_m``, world x, y.

        Args:
            centre_m: of its top, as far as that was felt.
            top_m: height of the top.
            stop: asked before each side whether to leave the rest out.
        """
        found: dict[str, SideTouch] = {}
        missing: dict[str, str] = {}
        begun_m = centre_m
        for name, yaw_rad, side in self._directions():
            felt = "interrupted" if stop() else self._feel_side(centre_m, yaw_rad, side)
            if isinstance(felt, str):
                missing[name] = felt
            else:
                found[name] = felt
            if set(found) in (set(SIDES), {*SIDES, "back", "front"}):
                centre_m = self._between(found, centre_m)
        touches = list(found.values())
        if not missing and not stop() and np.linalg.norm(centre_m - begun_m) > _ASKEW_m:
            again = [self._feel_side(centre_m, yaw_rad, side) for _, yaw_rad, side in self._directions()[:2]]
            touches += [touch for touch in again if not isinstance(touch, str)]
        return self._box(touches, centre_m, top_m, missing)

    def _between(self, found: Mapping[str, SideTouch], centre_m: Array) -> Array:
        """The middle between opposite sides: fingers of a tap often meet one part of a top only."""
        yaw, pair = float(np.mean(self._window_rad)), list(found.values())[-2:]
        ahead = np.array([np.cos(yaw), np.sin(yaw)])
        across = ahead if len(found) > len(SIDES) else np.array([-ahead[1], ahead[0]])
        middle_m = np.mean([(touch.points_m[:, :2] @ across).mean() for touch in pair])
        return np.asarray(centre_m + (middle_m - centre_m @ across) * across)

    def _directions(self) -> list[tuple[str, float, str]]:
        """Where the object is touched, the yaw of the hand for that, and the side of its palm."""
        low, high = self._window_rad
        middle, most = (low + high) / 2, min(np.pi / 2, (high - low) / 2)
        left, right = SIDES
        return [
            ("left", middle, left),
            ("right", middle, right),
            ("back", middle + most, left),
            ("front", middle - most, left),
        ]

    def _feel_side(self, centre_m: Array, yaw_rad: float, side: str) -> SideTouch | str:
        """The contacts on a side; why there are none, else."""
        blocked = 0
        for lane_m in self._lanes_m:
            frame = GraspFrame(float(centre_m[0]), float(centre_m[1]), yaw_rad).shifted_inside(np.array([lane_m, 0.0]))
            places = [TouchPlace(frame, self._toucher.lowest_m(side), _LOW_m)]
            felt = self._toucher.touch_side(places, side, self._search_m)
            if felt is None:
                felt = self._toucher.touch_side(places, side, self._search_m + _AGAIN_m)
            if felt is not None and len(felt):
                return felt
            blocked += felt is None
        if blocked:
            return f"something stands {1e3 * self._search_m:.0f} mm from where the object is expected"
        return f"nothing touched in {len(self._lanes_m)} lanes"

    def _box(self, found: list[SideTouch], centre_m: Array, top_m: float, missing: dict[str, str]) -> BoundingBox:
        """Around all that was felt; where hardly anything was, as far as objects typically reach."""
        points_m = np.vstack([np.empty((0, 3)), *(touch.points_m for touch in found)])
        normals = np.vstack([np.empty((0, 3)), *(touch.normals for touch in found)])
        beside = on_sides(normals)
        assumed_m = np.array([[*(centre_m + _ASSUMED_m * way), 0.0] for way in np.vstack([np.eye(2), -np.eye(2)])])
        if beside.any():
            pose, low_m, high_m = fit_box(points_m[beside], normals[beside])
        else:
            pose, low_m, high_m = fit_box(assumed_m, np.vstack([np.eye(3)[:2], -np.eye(3)[:2]]))
        if missing:
            places = np.array([pose.transformTo(place[:2]) for place in assumed_m])
            low_m, high_m = np.minimum(low_m, places.min(axis=0)), np.maximum(high_m, places.max(axis=0))
        return BoundingBox(pose, low_m, high_m, self._margin_m, top_m, missing)
