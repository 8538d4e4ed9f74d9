"""Plans grasps from the hand's own contacts, without an estimate.

The first grasps of a session, and all grasps after the estimation has lost the object, follow a fixed rule: the grasp
frame is placed where the last contacts indicate the object, the yaw alternates between both sides of the arm's window,
the closings alternate too. :mod:`tactile_lab.autonomy.variance_planner` chooses better once there is an estimate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from pydantic import Field, model_validator

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array, Grasp
from drivers.core.poses import transform_points
from drivers.shadow.closing.closing import PRESHAPES, HIGHEST_m, LOWEST_m
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import ContactHeight, GraspPlan

HasRoom: TypeAlias = Callable[[GraspPlan], bool]
"""Whether a plan is free of obstacles that only the session knows."""


def anywhere(plan: GraspPlan) -> bool:
    """No obstacle for any plan."""
    return True


class PlanSettings(StrictModel):
    """Settings of the planner.

    Attributes:
        closings: closings to alternate between; radial first, as its contacts determine the object frame, while a pinch
            does not determine the position along the fingers.
        contour_heights_m: heights of the fingertip centres above the table, in turn, when a contour is wanted.
        surface_heights_m: the same when the whole surface is wanted. Unsuitable heights are skipped once the object's
            top was touched.
        contour_top_m: assumed height of objects until then.
        yaw_window_rad: lowest and highest yaw of the grasp frame that the arm can reach.
        start_m: expected position of the object before the first grasp, world x, y.
        turn_rad: smallest and largest re-orientation.
        return_m: largest step back toward ``start_m`` while the object is carried.
        tap_every: interval of grasps that start with a tap on the top if the whole surface is wanted; 0: never.
    """

    closings: tuple[str, ...] = Field(default=("radial", "pinch"), min_length=1)
    contour_heights_m: tuple[ContactHeight, ...] = Field(default=(0.034,), min_length=1)
    surface_heights_m: tuple[ContactHeight, ...] = Field(default=(0.034, 0.018, 0.048), min_length=1)
    contour_top_m: float = Field(default=0.05, gt=0.0)
    yaw_window_rad: tuple[float, float] = (-1.31, 1.31)
    start_m: tuple[float, float] = (0.0, 0.0)
    turn_rad: tuple[float, float] = (0.23, 0.79)
    return_m: float = Field(default=0.03, ge=0.0)
    tap_every: int = Field(default=2, ge=0)

    @model_validator(mode="after")
    def _sensible(self) -> PlanSettings:
        if unknown := sorted(set(self.closings) - set(PRESHAPES)):
            raise ValueError(f"unknown closings {unknown}; choose from {', '.join(PRESHAPES)}")
        if not self.yaw_window_rad[0] < self.yaw_window_rad[1]:
            raise ValueError("the yaw window's first value must be the smaller one")
        if not 0.0 <= self.turn_rad[0] <= self.turn_rad[1]:
            raise ValueError("the re-orientation's first value must be the smaller one, and not negative")
        return self

    def as_felt(self, top_m: float | None, outline_m: float = 0.0) -> PlanSettings:
        """The same for one object.

        Args:
            top_m: height of its top as it was touched; None if it was not. Contours are felt below it.
            outline_m: height from which on its outline can be felt.
        """
        expected_m = self.contour_top_m if top_m is None else top_m
        heights_m = self.contour_heights_m if top_m is None else _fitting(self.contour_heights_m, top_m)
        raised_m = tuple(dict.fromkeys(max(height_m, outline_m) for height_m in heights_m))
        return self.model_copy(update={"contour_heights_m": raised_m, "contour_top_m": expected_m})


_OTHER_YAWS = 12
_BELOW_TOP_m, _ROOM_m = 0.005, 0.033  # above the fingertips' centres, the lowest proximal link being 33 mm higher
_JUST_BELOW_TOP_m = 0.010
"""Fingertips so high meet what is wide at the top, however narrow it is below."""

_RAISE_m = 0.005

_TYPICAL_HALF_WIDTH_m = 0.030  # between one side's contacts and the middle, where only one side touches
_MISSED_SIDE_m = {"FF": -0.012, "MF": -0.004, "RF": 0.004, "LF": 0.012}  # a finger that met nothing: object is aside


def _fits(height_m: float, top_m: float) -> bool:
    """Whether fingertips so high are below the top, and what is above them over it."""
    return height_m + _BELOW_TOP_m < top_m < height_m + _ROOM_m


def _fitting(heights_m: tuple[float, ...], top_m: float) -> tuple[float, ...]:
    """Those that fit; otherwise the highest, or just below the top."""
    just_below_m = max(top_m - _JUST_BELOW_TOP_m, LOWEST_m)
    return tuple(each for each in heights_m if _fits(each, top_m)) or (min(max(heights_m), just_below_m),)


def contact_centre(grasp: Grasp, plan: GraspPlan, form: HandForm = RIGHT_HAND) -> Array:
    """Centre of the object, world x, y, from one grasp's contacts alone.

    Across the hand it is midway between thumb and fingers; along it, midway between the outer fingers if they close
    from the sides, otherwise away from the fingers that met nothing.
    """
    frame = plan.frame.pose
    closed = [contact for contact in grasp.contacts if not contact.probed]
    points_m = transform_points(frame.inverse(), np.array([c.point_world_m for c in closed]).reshape(-1, 3))[:, :2]
    touched = dict(zip((contact.finger for contact in closed), points_m, strict=True))
    centre_m = np.array([_across(touched), _along(touched, plan.closing, form), 0.0])
    return np.asarray(transform_points(frame, centre_m[None])[0, :2])


def _across(touched: dict[str, Array]) -> float:
    fronts = [point[0] for finger, point in touched.items() if finger != "TH"]
    match bool(fronts), "TH" in touched:
        case True, True:
            return float(max(fronts) + touched["TH"][0]) / 2
        case True, False:
            return float(np.mean(fronts)) - _TYPICAL_HALF_WIDTH_m
        case False, True:
            return float(touched["TH"][0]) + _TYPICAL_HALF_WIDTH_m
        case _:
            return 0.0


def _along(touched: dict[str, Array], closing: str, form: HandForm) -> float:
    if not touched:
        return 0.0
    outer = {form.long_fingers[0], form.long_fingers[-1]}
    if closing == "radial" and len(outer) == 2 and outer <= set(touched):
        return float(sum(touched[finger][1] for finger in outer)) / 2
    missed_m = sum(_MISSED_SIDE_m[finger] for finger in form.long_fingers if finger not in touched)
    return -missed_m if form.is_left else missed_m


class HeuristicPlanner:
    """Plans grasps and re-orientations without an estimate of the shape.

    Args:
        settings: see there.
        rng: the session's random numbers.
        dimension: 2 when a contour is wanted, 3 for a surface.
    """

    def __init__(self, settings: PlanSettings, rng: np.random.Generator, dimension: int = 2) -> None:
        self.settings, self._rng = settings, rng
        self._wants_top = dimension == 3
        self._heights_m = settings.contour_heights_m if dimension == 2 else settings.surface_heights_m
        self.centre_m: Array = np.array(settings.start_m)
        """Estimated position of the object, world x, y."""

        self.top_m: float | None = None
        """Height of its top above the table, if it was touched."""

    def plan(self, index: int, has_room: HasRoom = anywhere, is_clear: HasRoom = anywhere) -> GraspPlan:
        """The grasp number ``index``, from 0: on the next side in turn, or anywhere else with room.

        Args:
            index: of the grasp.
            has_room: whether the open fingers can come down.
            is_clear: whether no link meets the object then. Where one would everywhere, fingertips are higher; where
                that does not help either, it is as if nothing was known of it.
        """
        side = 0.53 if index % 2 else -0.53
        first = self._at(index, side + self._rng.uniform(-0.19, 0.19), "alternating yaw")
        if has_room(first) and is_clear(first):
            return first
        plans = [first, *(self._elsewhere(index) for _ in range(_OTHER_YAWS))]
        raised = (replace(plan, height_m=height_m) for height_m in self._raised_m(first.height_m) for plan in plans)
        in_the_way = next(filter(has_room, plans), plans[-1])
        return next((plan for plan in raised if has_room(plan) and is_clear(plan)), in_the_way)

    def _elsewhere(self, index: int) -> GraspPlan:
        return self._at(index, self._rng.uniform(-1.0, 1.0), "a yaw with room for the hand")

    def _raised_m(self, height_m: float) -> Iterator[float]:
        """A contact height and those above it, up to just below the top."""
        highest_m = min(self.expected_top_m - _JUST_BELOW_TOP_m, HIGHEST_m)
        yield from np.arange(height_m, max(height_m, highest_m) + _RAISE_m / 2, _RAISE_m).tolist()

    @property
    def expected_top_m(self) -> float:
        """Height of the top as it was touched, otherwise as it is assumed."""
        return self.settings.contour_top_m if self.top_m is None else self.top_m

    def _at(self, index: int, place: float, reason: str) -> GraspPlan:
        """A grasp at a place in the yaw window, from -1 to 1."""
        low, high = self.settings.yaw_window_rad
        yaw = (low + high) / 2 + place * (high - low) / 2
        frame = GraspFrame(float(self.centre_m[0]), float(self.centre_m[1]), float(yaw))
        return GraspPlan(frame, self.closing(index), self.height_m(index), reason)

    def closing(self, index: int) -> str:
        """The next closing in turn: each twice, so that it is used on both sides of the window."""
        return self.settings.closings[(index // 2) % len(self.settings.closings)]

    def taps(self, index: int) -> bool:
        """Whether the grasp starts with a tap on the top."""
        felt = index == 0 and self.top_m is not None
        return self._wants_top and not felt and self.settings.tap_every > 0 and index % self.settings.tap_every == 0

    def height_m(self, index: int) -> float:
        """The next contact height in turn, among those at which the hand has room above the object."""
        heights_m = self._heights_m if self.top_m is None else _fitting(self._heights_m, self.top_m)
        return heights_m[(index + index // 4) % len(heights_m)]

    @property
    def fitting_heights_m(self) -> tuple[float, ...]:
        """Contact heights at which the hand has room above the object, also just below its top; none if that was not
        touched.
        """
        if (top_m := self.top_m) is None:
            return ()
        just_below_m = float(np.clip(top_m - _JUST_BELOW_TOP_m, LOWEST_m, HIGHEST_m))
        return tuple(height_m for height_m in (*self._heights_m, just_below_m) if _fits(height_m, top_m))

    def turn(self, yaw_rad: float) -> float:
        """A re-orientation that keeps the hand in its yaw window."""
        low, high = self.settings.yaw_window_rad
        least, most = self.settings.turn_rad
        size = float(self._rng.uniform(least, most))
        if yaw_rad + size <= high:
            return size
        if yaw_rad - size >= low:
            return -size
        room_up, room_down = max(0.0, high - yaw_rad), max(0.0, yaw_rad - low)
        return room_up if room_up >= room_down else -room_down

    def step_back(self, centre_m: Array) -> Array:
        """Shift (2,) in the world that brings an object at ``centre_m`` closer to its start."""
        step_m = np.array(self.settings.start_m) - centre_m
        size_m = float(np.linalg.norm(step_m))
        return np.asarray(step_m * min(1.0, self.settings.return_m / size_m)) if size_m > 0 else step_m
