"""The bounding box of an unknown object, measured by touch before the first grasp (thesis figure 4.2).

The order is the figure's: top, left, front, right, back. The top is tapped. A side is raked: the four fingers hang in a
row, the thumb held up, and come toward the object in lanes until one meets it. The back, the side toward the arm,
cannot be raked if the arm cannot turn around: there only the thumb closes, with the fingers open beyond the front. A
side that is not found (nothing in any lane, descent blocked) is assumed to be as far away as was searched, and is
reported. Afterwards open fingertips keep out of the box and its margin, so that the hand grasps across the side it can
span.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from gtsam import Pose2
from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from sessions.motion.motion import GraspFrame
from sessions.motion.touching import Toucher

SIDES = ("left", "front", "right", "back")
"""Sides besides the top, in the figure's order; the front faces away from the arm."""

_ASSUMED_m = 0.030
"""Distance from the middle to a side that was not found."""

_BEYOND_m = -0.040
"""From the front to the grasp frame in which the open fingers stand 25 mm clear of it."""

_THUMB_ASIDE_m = 0.014
"""Offset of the thumb's path from the middle of the grasp frame, toward its +y."""

_SHORT_OF_ENDS_m = 0.005
"""Least distance of the thumb from the ends of the width: nearer, it would pass beside the object."""

_TURNS_rad = {"left": np.pi / 2, "front": 0.0, "right": -np.pi / 2, "back": np.pi}


class ProbingSettings(StrictModel):
    """How the bounding box is measured.

    Attributes:
        enabled: measure it before the first grasp.
        search_m: distance from the object's expected position at which the search starts on every side.
        lanes_m: offsets of the lanes across the direction of a rake; neighbouring ones no farther apart than the row is
            wide.
        thumb_lane_m: spacing of the lanes in which the thumb touches the back.
        margin_m: added on every side: contacts are few, and the corner may lie between lanes.
        tallest_m: the palm does not pass over higher objects: their sides are not measured.
    """

    enabled: bool = False
    search_m: float = Field(default=0.13, gt=0.0)
    lanes_m: tuple[float, ...] = Field(default=(0.0, -0.05, 0.05), min_length=1)
    thumb_lane_m: float = Field(default=0.025, gt=0.0)
    margin_m: float = Field(default=0.008, ge=0.0)
    tallest_m: float = Field(default=0.075, gt=0.0)


@dataclass(frozen=True)
class BoundingBox:
    """The measured box.

    Attributes:
        world_T_box: its axes: x away from the arm. It moves with the object.
        low_m, high_m: its extent there, without margin, shape (2,).
        margin_m: additional margin.
        top_m: height of the top; None if it was not found.
        missing: the sides that were not found, and why.
    """

    world_T_box: Pose2
    low_m: Array
    high_m: Array
    margin_m: float
    top_m: float | None
    missing: Mapping[str, str]

    @property
    def is_found(self) -> bool:
        """Whether anything was found."""
        return self.top_m is not None or len(self.missing) < len(SIDES)

    @property
    def centre_world_m(self) -> Array:
        """Its middle in the world, shape (2,)."""
        return np.asarray(self.world_T_box.transformFrom((self.low_m + self.high_m) / 2))

    def move(self, motion: Pose2) -> BoundingBox:
        """After the object was carried."""
        return replace(self, world_T_box=motion * self.world_T_box)

    def is_clear(self, points_world_m: Array) -> bool:
        """Whether places, shape (n, 2), all lie outside of the box and its margin."""
        places = np.array([self.world_T_box.transformTo(point) for point in points_world_m])
        low, high = self.low_m - self.margin_m, self.high_m + self.margin_m
        return bool(np.all(np.any((places < low) | (places > high), axis=1)))

    def in_words(self) -> str:
        """Size and what is missing, for people."""
        length, width = 1e3 * (self.high_m - self.low_m)
        top = "top not found" if self.top_m is None else f"{1e3 * self.top_m:.0f} mm high"
        missing = "".join(f"; {side} not found: {why}" for side, why in self.missing.items())
        return f"bounding box {length:.0f} x {width:.0f} mm, {top}{missing}"


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
        toucher: Toucher,
        settings: ProbingSettings,
        yaw_window_rad: tuple[float, float],
        start_m: tuple[float, float],
    ) -> None:
        self._toucher, self._settings, self._window_rad = toucher, settings, yaw_window_rad
        self._axes = Pose2(start_m[0], start_m[1], float(np.mean(yaw_window_rad)))

    def feel(self, stop: Callable[[], bool] = lambda: False) -> BoundingBox:
        """Top, left, front, right, back; ``stop`` is asked before each whether to skip the rest."""
        found: dict[str, Array] = {}
        missing: dict[str, str] = {}
        top_m = None if stop() else self._top_m()
        for side in SIDES:
            if stop():
                missing[side] = "interrupted"
            elif top_m is not None and top_m > self._settings.tallest_m:
                missing[side] = f"the palm does not pass over {1e3 * top_m:.0f} mm"
            else:
                points = self._by_closing(found) if self._by_thumb(side) else self._rake(side)
                if isinstance(points, str):
                    missing[side] = points
                else:
                    found[side] = points
        return self._box(found, missing, top_m)

    def _top_m(self) -> float | None:
        """Height of the highest fingertip that touched something when they were laid on."""
        points = self._toucher.tap(GraspFrame(self._axes.x(), self._axes.y(), self._axes.theta()))
        return float(points[:, 2].max()) if len(points) else None

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
        for lane_m in self._thumb_lanes_m(found):
            place = self._axes.transformFrom(np.array([front_m + _BEYOND_m, lane_m - _THUMB_ASIDE_m]))
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
