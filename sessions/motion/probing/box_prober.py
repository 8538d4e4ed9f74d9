"""The bounding box of an unknown object, measured by touch before the first grasp (thesis figure 4.2).

The order is the figure's: top, left, front, right, back. The top is tapped. A side is raked: the four fingers hang in a
row, the thumb held up, and come toward the object in lanes until one meets it. The back, the side toward the arm,
cannot be raked if the arm cannot turn around: there only the thumb closes, with the fingers open beyond the front. A
side that is not found (nothing in any lane, descent blocked) is assumed to be as far away as was searched, and is
reported. Afterwards open fingertips keep out of the box and its margin, so that the hand grasps across the side it can
span.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

import numpy as np
from gtsam import Pose2
from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.probing.bounding_box import SIDES, BoundingBox
from sessions.motion.probing.raking import Raker
from sessions.motion.probing.side_survey import SideSurvey

_ASSUMED_m = 0.030
"""Distance from the middle to a side that was not found."""

_AROUND = ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
"""Where the top is looked for next."""

_SAME_TOP_m = 0.010
"""An object that is met as high as before, but for so much, stands."""

_BEYOND_m = -0.040
"""From the front to the grasp frame in which the open fingers stand 25 mm clear of it."""

_THUMB_ASIDE_m = 0.014
"""Offset of the thumb's path from the middle of the grasp frame, toward the first finger's side."""

_SHORT_OF_ENDS_m = 0.005
"""Least distance of the thumb from the ends of the width: nearer, it would pass beside the object."""

_TURNS_rad = {"left": np.pi / 2, "front": 0.0, "right": -np.pi / 2, "back": np.pi}


class ProbingSettings(StrictModel):
    """How the bounding box is measured.

    Attributes:
        top: feel how tall the object is before anything else, and the sides of what the palm does not pass over. Only
            where nothing tall is ever put on the table can that be left out.
        enabled: feel the sides of what the palm passes over too.
        highest_m: as tall an object may be; the hand travels above that until it has felt the top.
        search_m: how far from where the object is expected the search begins on every side.
        lanes_m: offsets of the lanes across the direction of a rake; two lie no farther apart than the row is wide.
        thumb_lane_m: distance of the lanes in which the thumb feels the back.
        margin_m: added on every side: contacts are few, and the corner may lie between lanes.
        tallest_m: over objects higher than this the palm does not pass: their sides are touched with the palm upright.
        around_m: how far around its expected place the object's top is searched if nothing was touched.
    """

    top: bool = True
    enabled: bool = False
    highest_m: float = Field(default=0.25, gt=0.0)
    search_m: float = Field(default=0.13, gt=0.0)
    lanes_m: tuple[float, ...] = Field(default=(0.0, -0.05, 0.05), min_length=1)
    thumb_lane_m: float = Field(default=0.025, gt=0.0)
    margin_m: float = Field(default=0.008, ge=0.0)
    tallest_m: float = Field(default=0.08, gt=0.0)
    around_m: float = Field(default=0.05, gt=0.0)

    @property
    def is_wanted(self) -> bool:
        """Whether anything is felt before the first grasp."""
        return self.top or self.enabled


class BoxProber:
    """Measures the bounding box.

    Args:
        toucher: touches with the hand.
        settings: see there.
        yaw_window_rad: of the arm.
        start_m: expected position of the object, world x, y.
    """

    def __init__(
        self,
        toucher: Raker,
        settings: ProbingSettings,
        yaw_window_rad: tuple[float, float],
        start_m: tuple[float, float],
    ) -> None:
        self._toucher, self._settings, self._window_rad = toucher, settings, yaw_window_rad
        self._axes = Pose2(start_m[0], start_m[1], float(np.mean(yaw_window_rad)))
        lanes_m, margin_m = settings.lanes_m, settings.margin_m
        self._sides = SideSurvey(toucher, yaw_window_rad, settings.search_m, lanes_m, margin_m)

    def feel(self, stop: Callable[[], bool] = lambda: False) -> BoundingBox:
        """Top, left, front, right, back; ``stop`` is called before each, and returns whether to skip the rest.

        The palm passes over what is low: its sides are raked, if they are wanted. What is taller is touched from its
        sides in any case.
        """
        self._toucher.expect_tallest(self._settings.highest_m)
        aside_m = (np.zeros(2), *(self._settings.around_m * np.array(way) for way in _AROUND))
        top = self._feel_top([np.asarray(self._axes.transformFrom(place)) for place in aside_m], stop)
        self._toucher.on_top(float(top[:, 2].max()) if len(top) else 0.0)
        return self._feel_below(top, stop)

    def find_again(self, stop: Callable[[], bool], places_m: Array, top_m: float | None) -> BoundingBox:
        """Feel an object that may have fallen over or been pushed.

        Args:
            stop: as in :meth:`feel`.
            places_m: where it is tapped on, until it is met, world x, y, shape (n, 2).
            top_m: met so high at the first place it stands as it stood, and nothing else is felt; None: its sides are.
        """
        first = self._feel_top(places_m[:1], stop)
        stands = top_m is not None and len(first) and abs(first[:, 2].max() - top_m) < _SAME_TOP_m
        if stands:
            return replace(self._box({}, dict.fromkeys(SIDES, "as before"), top_m), has_sides=False)
        top = first if len(first) else self._feel_top(places_m[1:], stop)
        if len(top):
            self._toucher.on_top(float(top[:, 2].max()))
            self._axes = Pose2(float(top[:, 0].mean()), float(top[:, 1].mean()), self._axes.theta())
        return self._feel_below(top, stop)

    def _feel_below(self, top: Array, stop: Callable[[], bool]) -> BoundingBox:
        top_m = float(top[:, 2].max()) if len(top) else None
        if top_m is not None and top_m > self._settings.tallest_m:
            return self._sides.feel(top[:, :2].mean(axis=0), top_m, stop)
        if not self._settings.enabled:
            untouched = dict.fromkeys(SIDES, "left to the grasps")
            return replace(self._box({}, untouched, top_m), has_sides=False)
        found: dict[str, Array] = {}
        missing: dict[str, str] = {}
        for side in SIDES:
            points = "interrupted" if stop() else self._feel_side(side, found)
            if isinstance(points, str):
                missing[side] = points
            else:
                found[side] = points
        return self._box(found, missing, top_m)

    def _feel_side(self, side: str, found: Mapping[str, Array]) -> Array | str:
        return self._by_closing(found) if self._by_thumb(side) else self._rake(side)

    def _feel_top(self, places_m: Iterable[Array], stop: Callable[[], bool]) -> Array:
        """Where fingertips met the object when they were laid on, shape (n, 3), at the first of the places, world x, y,
        where they met anything.
        """
        points: Array = np.empty((0, 3))
        for x_m, y_m in places_m:
            if stop() or len(points := self._toucher.tap(GraspFrame(float(x_m), float(y_m), self._axes.theta()))):
                break
        return points

    def _by_thumb(self, side: str) -> bool:
        low, high = self._window_rad
        return side == "back" and high - low < 2 * np.pi - 0.1

    def _rake(self, side: str) -> Array | str:
        """Where fingertips touched the object, shape (n, 2), box frame; otherwise the reason."""
        low, high = self._window_rad
        yaw = float(np.clip(self._axes.theta() + _TURNS_rad[side], low, high))
        landed, found = 0, []
        for lane_m in self._settings.lanes_m:
            outward = np.array([np.cos(yaw), np.sin(yaw)])
            x, y = np.asarray(self._axes.translation()) + lane_m * np.array([-outward[1], outward[0]])
            points = self._toucher.rake(GraspFrame(float(x), float(y), yaw), self._settings.search_m)
            if points is None:
                landed += 1
            elif len(points):
                found.append(points)
        if found:
            return self._in_box_frame(np.vstack(found))
        if landed:
            return f"something stands {1e3 * self._settings.search_m:.0f} mm from where the object is expected"
        return f"nothing touched in {len(self._settings.lanes_m)} lanes"

    def _by_closing(self, found: Mapping[str, Array]) -> Array | str:
        """The back, by the thumb in lanes: the fingers stand open beyond the front, or where that would be.

        A single lane would miss the corner of an object that is turned.
        """
        front_m = max((float(points[:, 0].max()) for points in found.values()), default=_ASSUMED_m)
        landed, met = 0, []
        aside_m = self._toucher.first_finger_side * _THUMB_ASIDE_m
        for lane_m in self._thumb_lanes_m(found):
            place = self._axes.transformFrom(np.array([front_m + _BEYOND_m, lane_m - aside_m]))
            frame = GraspFrame(float(place[0]), float(place[1]), float(self._axes.theta()))
            points = self._toucher.close_thumb(frame)
            if points is None:
                landed += 1
            elif len(points):
                met.append(points)
        if met:
            return self._in_box_frame(np.vstack(met))
        return "the thumb cannot descend beside the object" if landed else "the thumb touched nothing"

    def _thumb_lanes_m(self, found: Mapping[str, Array]) -> Array:
        """Lanes of the thumb, from the middle outwards, box frame y: over the measured width, short of its ends."""
        sides_m = [points[:, 1] for side, points in found.items() if side in ("left", "right")]
        every_m = np.concatenate([*sides_m, *([np.zeros(1)] if not sides_m else [])])
        half_m = np.ptp(every_m) / 2 - _SHORT_OF_ENDS_m
        count = int(max(0.0, half_m) // self._settings.thumb_lane_m)
        lanes_m = (every_m.min() + every_m.max()) / 2 + self._settings.thumb_lane_m * np.arange(-count, count + 1)
        return np.asarray(sorted(lanes_m, key=lambda lane_m: abs(lane_m - lanes_m.mean())))

    def _in_box_frame(self, points_m: Array) -> Array:
        return np.array([self._axes.transformTo(point[:2]) for point in points_m])

    def _box(self, found: Mapping[str, Array], missing: Mapping[str, str], top_m: float | None) -> BoundingBox:
        """The box around all touched points; toward a side that was not found, at least the
        typical extent of objects.
        """
        every = np.vstack(list(found.values())) if found else np.zeros((1, 2))
        low, high = every.min(axis=0), every.max(axis=0)
        middle = (low + high) / 2
        for side, (axis, bound, assumed, outer) in {
            "left": (1, high, middle + _ASSUMED_m, np.maximum),
            "right": (1, low, middle - _ASSUMED_m, np.minimum),
            "front": (0, high, middle + _ASSUMED_m, np.maximum),
            "back": (0, low, middle - _ASSUMED_m, np.minimum),
        }.items():
            if side in missing:
                bound[axis] = outer(bound[axis], assumed[axis])
        return BoundingBox(self._axes, low, high, self._settings.margin_m, top_m, dict(missing))
