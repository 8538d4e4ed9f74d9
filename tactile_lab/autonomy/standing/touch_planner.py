"""Touches without a grasp: taps beside one another on the top, single sides at any height and place.

They reach what no closing spans: sides wider apart than the hand opens, a wide top, what lies too low or too near
something for the palm. One touch tells less than a grasp, and pushes from one side, so only as high as the object
would rather slide than tip.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.shadow.closing.closing import SIDES, closing, sideways
from drivers.shadow.closing.finger_down import FINGER
from sessions.motion.cycle_settings import TouchSettings
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan, TouchPlace
from sessions.motion.probing.touch_patterns import COLUMN, TAP, TAP_HEIGHT_m, lowest_touch_m
from tactile_lab.autonomy.standing.candidate import ActionPlanner, StandingCandidate, approach_of
from tactile_lab.autonomy.standing.side_clearance import StandingBox
from tactile_lab.autonomy.standing.side_planner import slides_up_to_m
from tactile_lab.autonomy.standing.storeys import Storeys

_TAPS_APART_m, _LANES_APART_m, _HEIGHTS_APART_m = 0.015, 0.025, 0.025
_INSIDE_m = 0.008
"""From the edges of a face to the places where it is touched."""

_WHOLE_TOP = 3.0
"""A contact on a top that nothing has felt is worth as much as so many: it tells how tall the object is."""

_TAP_TURNS_rad = np.radians([0.0, 30.0, -30.0, 60.0, -60.0])
"""Of a tap, from the middle of the arm's range."""

_BESIDE_m = 0.004
"""From the top's edge to a fingertip that passes beside it in a tap: a box that was felt is not known better."""

_ASKEW_rad = np.radians(20.0)
"""A side that the arm cannot turn to squarely is touched so much from aside: fingertips do not slip yet."""

_SQUARELY = 0.7
"""Of the half width of what is round: farther aside a finger passes beside it, and a link meets it."""

_PLACES, _STEP_m, _LEAST_NEWS_m = 3, 0.09, 0.015
"""One coming of the hand touches a side at so many places, each no farther from the last, and with its contacts
so far from those that are known on average."""

_CLOSINGS_REACH_m = 0.055
"""So far from the ends of a side closings tell where it is; a box that was felt askew seems wider than it is."""

_HIGHEST = 0.8
"""Of its height an object that does not slide is pushed at."""

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
        best_first = sorted(
            (*self._taps(), *self._sides(), *self._one_finger()), key=lambda one: one.score_m, reverse=True
        )
        return next((one for one in best_first if self._is_news(one) and self._is_open(one)), None)

    def _is_news(self, one: StandingCandidate) -> bool:
        """Whether it would tell anything new; a tap that would not is not offered at all."""
        return one.on_top or bool(self.felt.are_new(one.touches_m).any())

    def _is_open(self, one: StandingCandidate) -> bool:
        return not self._was_blocked(one.plan) and self.reach.holds(one.plan, self.hand)

    def _was_blocked(self, plan: GraspPlan) -> bool:
        """Whether the hand met something on its way to nearly the same touch."""
        return any(
            plan.closing == other.plan.closing
            and abs(plan.height_m - other.plan.height_m) < _HEIGHTS_APART_m / 2
            and np.hypot(plan.frame.x_m - other.plan.frame.x_m, plan.frame.y_m - other.plan.frame.y_m) < _LANES_APART_m
            for other in self.blocked
        )

    @staticmethod
    def _plan(frame: GraspFrame, name: str, height_m: float, what: str, count: int) -> GraspPlan:
        return GraspPlan(frame, name, height_m, f"{what}: {count} contacts expected", only_touch=True)

    # --- from above ----------------------------------------------------------------------------------------------

    def _taps(self) -> Iterator[StandingCandidate]:
        """Side by side over the top, turned so that no finger comes down on an edge."""
        box, (low, high) = self.felt.storeys.boxes[-1], self.yaw_window_rad
        yaws_rad = [float(yaw) for yaw in (low + high) / 2 + _TAP_TURNS_rad if low <= yaw <= high]
        middles = [
            _at(box, along_m, across_m)
            for along_m in _places(box.size_m[0] / 2, _TAPS_APART_m)
            for across_m in _places(box.size_m[1] / 2, _TAPS_APART_m)
        ]
        frames = [GraspFrame(*middle, yaw_rad) for middle in middles for yaw_rad in yaws_rad]
        fingers, tips_m = self._tapping_tips()
        turned_m = {yaw_rad: GraspFrame(0.0, 0.0, yaw_rad).pose.matrix()[:3, :3] @ tips_m for yaw_rad in yaws_rad}
        places_m = np.array([turned_m[frame.yaw_rad] for frame in frames]).swapaxes(1, 2)
        places_m[..., :2] += np.array([[frame.x_m, frame.y_m] for frame in frames])[:, None]
        places_m[..., 2] = box.size_m[2]
        met = self._met(box, places_m)
        known_m = self.felt.distances_m(places_m.reshape(-1, 3), on_top=True).reshape(met.shape)
        for row in np.flatnonzero((met & self.felt.is_new(known_m)).any(axis=1)):
            tips = zip(fingers, places_m[row], met[row], strict=True)
            touches = {finger: place for finger, place, is_met in tips if is_met}
            plan = self._plan(frames[row], TAP.closing, TAP_HEIGHT_m, "tap on the top", len(touches))
            yield StandingCandidate(plan, touches, float(known_m[row][met[row]].sum()), on_top=True)

    def _one_finger(self) -> Iterator[StandingCandidate]:
        """One finger on the middle of a top that nothing has felt, small perhaps: all above it is open until then."""
        if self.felt.is_top_felt or FINGER not in self.hand.form.fingers:
            return
        box, (low, high) = self.felt.storeys.boxes[-1], self.yaw_window_rad
        place_m = np.array([[box.x_m, box.y_m, box.size_m[2]]])
        known_m = self.felt.distances_m(place_m, on_top=True)
        if self.felt.is_new(known_m).any():
            frame = GraspFrame(box.x_m, box.y_m, (low + high) / 2)
            plan = self._plan(frame, TAP.closing, TAP_HEIGHT_m, "one finger on the top", 1)
            plan = replace(plan, down_to_m=max(self.settings.lowest_m, box.size_m[2] - self.settings.below_top_m))
            yield StandingCandidate(plan, {FINGER: place_m[0]}, _WHOLE_TOP * float(known_m.sum()), on_top=True)

    def _tapping_tips(self) -> tuple[Sequence[str], Array]:
        """The fingers of a tap, and where their tips are in the grasp frame, shape (3, fingers)."""
        table = closing(TAP.closing, TAP_HEIGHT_m, self.hand)
        return table.fingers, np.array([table.path(f).centre_m(TAP.progress[f]) for f in table.fingers]).T

    def _met(self, box: StandingBox, places_m: Array) -> NDArray[np.bool_]:
        """Which fingertips at places (n, fingers, 3) meet the top, shape (n, fingers); none of a tap of which one would
        come down on an edge, and lean a link.
        """
        flat_m = places_m.reshape(-1, 3)
        outside_m = (box.outside_circle_m if self.felt.is_round else box.outside_m)(flat_m[:, :2])
        meets = outside_m < -_INSIDE_m / 2
        on_edge = ~meets & (outside_m < self.hand.radius_m + _BESIDE_m)
        met, shape = meets & ~self.felt.are_open(flat_m), places_m.shape[:2]
        return np.asarray(met.reshape(shape) & ~on_edge.reshape(shape).any(axis=1, keepdims=True))

    # --- from the side -------------------------------------------------------------------------------------------

    def _sides(self) -> Iterator[StandingCandidate]:
        """Every side that the arm can come to, in lanes, at heights where the object is not tipped over."""
        storeys, share = self.felt.storeys, _SQUARELY if self.felt.is_round else 1.0
        for yaw_rad in self.felt.yaws(self.yaw_window_rad, _ASKEW_rad):
            for side in SIDES:
                places = self._on_side(storeys, share, yaw_rad, side)
                yield from self._going_on([one for one in places if self._is_open(one)])

    def _on_side(self, storeys: Storeys, share: float, yaw_rad: float, side: str) -> Iterator[StandingCandidate]:
        """Touches by a hand that comes from one side, in lanes up to a share of the half width from the middle."""
        name, lowest_m = sideways(COLUMN.closing, side), lowest_touch_m(side, self.settings.side_heights_m, self.hand)
        box, across = self.felt.standing_box, np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
        way = approach_of(GraspPlan(GraspFrame(0.0, 0.0, yaw_rad), name, lowest_m), self.hand)
        if not self.felt.may_be_pushed(way):
            return
        foot_m = box.foot_along_m(way)
        up_to_m = min(slides_up_to_m(foot_m), box.size_m[2] - _INSIDE_m)
        low_m, laid_m = (lowest_m + 1e-9, 0.0) if self.felt.is_slender(way) else (np.inf, up_to_m)
        for height_m in np.arange(lowest_m, max(box.size_m[2] - _INSIDE_m, lowest_m + 1e-9), _HEIGHTS_APART_m).tolist():
            slides, met = height_m < min(up_to_m, low_m), storeys.at(height_m)
            for lane_m in _lanes_m(met, across, share):
                is_beyond = met.foot_along_m(across) - abs(lane_m) > _CLOSINGS_REACH_m
                front = self._front_m(met, met.centre_m + lane_m * across, way, height_m)
                if front is not None and (slides or (is_beyond and self._hardly_leans(height_m, foot_m))):
                    place = TouchPlace(GraspFrame(float(front[0]), float(front[1]), yaw_rad), height_m, laid_m)
                    yield self._at(place, name)

    def _front_m(self, met: StandingBox, lane: Array, way: Array, height_m: float) -> Array | None:
        """Where a side is expected in a lane, world x, y: behind where fingertips passed, beside a handle perhaps. None
        where they passed the middle.
        """
        out_m = met.way_out_m(lane, -way)
        passed_m = self.felt.passed_m(np.array([*(lane - out_m * way), height_m]), way)
        return None if passed_m > out_m else lane - (out_m - passed_m) * way

    def _at(self, place: TouchPlace, name: str) -> StandingCandidate:
        """A touch at a place on a side by a closing of that name."""
        front_m = np.array([place.frame.x_m, place.frame.y_m])
        touches = _touched(front_m, place.height_m, place.up_to_m, self.hand.form.long_fingers)
        plan = self._plan(place.frame, name, place.height_m, "one side touched", len(touches))
        novelty_m = self.felt.novelty_m(np.array(list(touches.values())))
        return StandingCandidate(replace(plan, places=(place,)), touches, novelty_m)

    def _hardly_leans(self, height_m: float, foot_m: float) -> bool:
        """Whether what gives way so high, as far as the hand goes, leans by less than half of what it falls at.

        Near its top it would lean before a fingertip feels it.
        """
        lean_m, top_m = self.settings.past_side_m, self.felt.standing_box.size_m[2]
        return not self.felt.is_round and lean_m * top_m / foot_m < height_m < _HIGHEST * top_m

    def _going_on(self, places: Sequence[StandingCandidate]) -> Iterator[StandingCandidate]:
        """Each of them, followed by those that tell most beside it; they all come to the same side."""
        for count in {len(one.touches) for one in places}:
            alike = [one for one in places if len(one.touches) == count]
            where_m = np.array([list(one.touches.values()) for one in alike])
            known_m = self.felt.distances_m(where_m.reshape(-1, 3)).reshape(where_m.shape[:2])
            for index in range(len(alike)):
                rows, gains_m = _tour(index, where_m, known_m)
                yield _together([alike[row] for row in rows], float(sum(gains_m)))


def _tour(first: int, where_m: Array, known_m: Array) -> tuple[list[int], list[float]]:
    """Places after the first one, and what each adds: which are near, and most news beside those before.

    Args:
        first: its row.
        where_m: of contacts, shape (places, contacts, 3).
        known_m: from each to the nearest that is known, shape (places, contacts).
    """
    rows, gains_m, left_m = [first], [float(known_m[first].sum())], known_m
    steps_m = np.linalg.norm(where_m[:, None, 0] - where_m[None, :, 0], axis=-1)
    while len(rows) < _PLACES:
        apart_m = np.linalg.norm(where_m[:, :, None] - where_m[rows[-1]][None, None], axis=-1).min(axis=-1)
        left_m = np.minimum(left_m, apart_m)
        news_m = np.where(steps_m[rows[-1]] < _STEP_m, left_m.sum(axis=1), 0.0)
        if news_m.max() < _LEAST_NEWS_m * where_m.shape[1]:
            break
        rows.append(int(np.argmax(news_m)))
        gains_m.append(float(news_m.max()))
    return rows, gains_m


def _together(places: Sequence[StandingCandidate], score_m: float) -> StandingCandidate:
    """One touch at all of these places."""
    first, *others = places
    if not others:
        return first
    further_m = np.vstack([one.touches_m for one in others])
    count = len(first.touches) + len(further_m)
    reason = f"one side touched at {len(places)} places: {count} contacts expected"
    plan = replace(first.plan, places=tuple(place for one in places for place in one.plan.places), reason=reason)
    return replace(first, plan=plan, score_m=score_m, further_m=further_m)


def _touched(front_m: Array, height_m: float, up_to_m: float, fingers: Sequence[str]) -> dict[str, Array]:
    """Where fingertips one above the other meet a side: all up to a height; else the lowest, which is ahead."""
    heights_m = height_m + _FINGERS_APART_m * np.arange(len(fingers))
    met_m = heights_m[: max(1, int(np.sum(heights_m < up_to_m)))]
    return {finger: np.array([*front_m, z]) for finger, z in zip(fingers, met_m, strict=False)}


def _places(half_m: float, apart_m: float) -> Array:
    """Evenly spread from the middle, as far as a face reaches from there."""
    count = int(max(0.0, half_m - _INSIDE_m) // apart_m)
    return np.asarray(apart_m * np.arange(-count, count + 1))


def _lanes_m(box: StandingBox, across: Array, share: float) -> list[float]:
    """How far aside from a box's middle, along a horizontal unit vector, shape (2,), a finger comes to its side: up to
    a share of its half width.
    """
    lanes_m = _places(share * box.half_along_m(across), _LANES_APART_m)
    places_m = np.column_stack([box.centre_m + lanes_m[:, None] * across, np.full(len(lanes_m), box.size_m[2] / 2)])
    return [float(lane) for lane in lanes_m[box.distances_m(places_m) <= -_INSIDE_m]]


def _at(box: StandingBox, along_m: float, across_m: float) -> tuple[float, float]:
    """A place given along the box's own axes, world x, y."""
    c, s = np.cos(box.yaw_rad), np.sin(box.yaw_rad)
    return float(box.x_m + c * along_m - s * across_m), float(box.y_m + s * along_m + c * across_m)
