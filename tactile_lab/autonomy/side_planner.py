"""Grasps from the side, palm upright, of what is too tall for the palm to pass over.

The object is known as a box, felt before the first grasp and fitted again to all contacts after each. The hand closes
across a side of the box, at any height the arm reaches, as deep behind its front as everything is clear; of those
grasps comes next the one whose contacts are expected farthest from all that was touched. The object is left where it
stands. Poses chosen by chance close before a rounded body or slip off a neck; with this rule 30 of 30 tries on seven
scanned objects put on at least three fingertips (decision 45).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from drivers.core.contacts import Array, Grasp
from drivers.shadow.closing.closing import SIDES, LOWEST_m, closing, sideways
from drivers.shadow.closing.posture import HandShape
from sessions.motion.bounding_box import BoundingBox
from sessions.motion.box_fit import fit_box, on_sides
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.motion import GraspFrame
from tactile_lab.autonomy.side_clearance import StandingBox, expected_touches, is_way_clear

_MARGIN_m = 0.003
"""Of the box that the hand keeps out of, beyond what was touched."""

_ASIDE_rad, _ROUND_rad = (0.0, np.radians(30.0), np.radians(-30.0)), np.radians(15.0)
"""Yaws beside those across the sides of the box, where contacts' normals are on average so far from the sides': what is
round has no sides. A hand that closes on the corner of a box pushes it away."""

_SURELY_m, _BELOW_TOP_m = 0.008, 0.012
"""A fingertip counts that meets a box so much smaller on its sides and at its top."""

_LEAST_FOR_BOX = 4
"""Contacts that tell a box."""

_HEIGHT_STEP_m, _DEPTH_STEP_m, _DEEPEST_m, _SHALLOWEST_m = 0.02, 0.005, 0.05, 0.005
_SHALLOWER_m = 0.010
"""So much less deep the hand comes where it was blocked."""

_FAR_m, _NEAR_m = 0.04, 0.010
"""What is touched farther than the first from all contacts is as new as can be; nearer than the second it is known."""

_LOW_FIRST = 0.1
"""Metres of novelty that a metre of height costs: low touches do not tip the object."""

_FRICTION = 0.5
"""Of the table and the foot, at most: a push higher than half the width by this tips an object before it slides."""

_ROW_m = 0.07
"""Height of the row of fingertips in a touch from the side."""


@dataclass(frozen=True)
class SideReach:
    """Where the palm may go.

    Attributes:
        radius_m: how far from ``centre_m``, world x, y.
        centre_m: of the workspace.
        standoff_m: how far before a grasp the hand comes down.
    """

    radius_m: float = 0.45
    centre_m: tuple[float, float] = (0.0, 0.0)
    standoff_m: float = 0.13


@dataclass(frozen=True)
class SideCandidate:
    """A grasp from the side, how deep it is, and where each finger is expected to touch, shape (3,), world."""

    plan: GraspPlan
    depth_m: float
    touches: Mapping[str, Array]

    @property
    def touches_m(self) -> Array:
        """All of these places, shape (n, 3)."""
        return np.array(list(self.touches.values()))


@dataclass
class SidePlanner:
    """Plans grasps around one tall object.

    Attributes:
        box: of the object, as felt.
        hand: its form, and the shape of its fingertips.
        yaw_window_rad: of the arm.
        reach: of the palm.
    """

    box: BoundingBox
    hand: HandShape
    yaw_window_rad: tuple[float, float]
    reach: SideReach
    _points_m: list[Array] = field(default_factory=list)
    _normals: list[Array] = field(default_factory=list)
    _missed_m: list[Array] = field(default_factory=list)
    _blocked: list[tuple[GraspPlan, float]] = field(default_factory=list)
    _current: SideCandidate | None = None
    _grasps: int = 0

    def plan(self) -> GraspPlan | None:
        """The next grasp; None where nothing is left that would tell anything new."""
        candidates = list(self._candidates())
        rated = [(self._novelty_m(one.touches_m) - _LOW_FIRST * one.plan.height_m, one) for one in candidates]
        rated = [(score, one) for score, one in rated if self._tells_something(one)]
        if not rated:
            return None
        self._current = max(rated, key=lambda pair: pair[0])[1]
        plan, touches = self._current.plan, len(self._current.touches_m)
        tap = self._is_near_side_new(plan)
        reason = f"{touches} contacts expected at {self._spread(self._current.touches_m)}"
        return replace(plan, tap=tap, reason=reason + (", its near side touched first" if tap else ""))

    @property
    def exhausted(self) -> str:
        """Why there is no other grasp, in words."""
        blocked = f", {len(self._blocked)} approaches were blocked" if self._blocked else ""
        return f"nothing left that the hand can reach: {self._grasps} grasps from the side{blocked}; {self.in_words()}"

    def in_words(self) -> str:
        """What hinders the hand, for people."""
        box = self._standing_box()
        width, length = sorted(1e3 * np.array(box.size_m[:2]))
        return f"the object is {width:.0f} x {length:.0f} mm wide and {1e3 * box.size_m[2]:.0f} mm high"

    @property
    def middle_m(self) -> Array:
        """Of the box, world x, y."""
        return self.box.centre_world_m

    # --- what has happened -------------------------------------------------------------------------------------

    def on_grasp(self, grasp: Grasp) -> None:
        """Take note of contacts, and fit the box again."""
        self._grasps += 1
        self._points_m += [contact.point_world_m for contact in grasp.contacts]
        self._normals += [contact.normal_world for contact in grasp.contacts]
        points_m, normals = np.array(self._points_m).reshape(-1, 3), np.array(self._normals).reshape(-1, 3)
        beside = on_sides(normals)
        if self._current is not None:
            self._missed_m += [place for f, place in self._current.touches.items() if f not in grasp.touching]
        if np.count_nonzero(beside) >= _LEAST_FOR_BOX:
            pose, low_m, high_m = fit_box(points_m[beside], normals[beside])
            top_m = max(self.box.top_m or 0.0, float(points_m[:, 2].max()))
            self.box = BoundingBox(pose, low_m, high_m, self.box.margin_m, top_m, self.box.missing)

    def on_blocked(self) -> None:
        """Take note that the hand met something on its way in."""
        if self._current is not None:
            self._blocked.append((self._current.plan, self._current.depth_m))

    # --- what can be done --------------------------------------------------------------------------------------

    def _standing_box(self) -> StandingBox:
        low, high = self.box.low_m, self.box.high_m
        (x, y), (length_m, width_m) = self.middle_m.tolist(), (high - low).tolist()
        return StandingBox(x, y, self.box.world_T_box.theta(), (length_m, width_m, self.box.top_m or 0.0))

    def _candidates(self) -> Iterator[SideCandidate]:
        """The deepest clear grasp across each side of the box, from both sides of the arm, at each height."""
        felt = self._standing_box()
        box, surely = felt.grow(_MARGIN_m, 0.0), felt.grow(-_SURELY_m, -_BELOW_TOP_m)
        for yaw_rad in self._yaws():
            for side in SIDES:
                for height_m in np.arange(LOWEST_m, max(felt.size_m[2] - _BELOW_TOP_m, LOWEST_m), _HEIGHT_STEP_m):
                    name = sideways("pinch", side)
                    if found := self._deepest(name, yaw_rad, float(height_m), box, surely):
                        yield found

    def _yaws(self) -> list[float]:
        """Across the sides of the box, as far as the arm turns."""
        low, high = self.yaw_window_rad
        theta, asides = self.box.world_T_box.theta(), _ASIDE_rad if self._is_round() else (0.0,)
        yaws = [theta + quarter * np.pi / 2 + aside for quarter in range(-3, 4) for aside in asides]
        return [float(yaw) for yaw in yaws if low <= yaw <= high]

    def _is_round(self) -> bool:
        """Whether contacts' normals say that the box is no box."""
        normals = np.array(self._normals).reshape(-1, 3)
        normals = normals[on_sides(normals)]
        angles = np.arctan2(normals[:, 1], normals[:, 0]) - self.box.world_T_box.theta()
        off = np.abs(angles - np.round(angles / (np.pi / 2)) * (np.pi / 2))
        return len(off) >= _LEAST_FOR_BOX and float(off.mean()) > _ROUND_rad

    def _deepest(
        self, name: str, yaw_rad: float, height_m: float, box: StandingBox, surely: StandingBox
    ) -> SideCandidate | None:
        approach = np.array(closing(name, height_m, self.hand).approach[:2])
        c, s = np.cos(yaw_rad), np.sin(yaw_rad)
        way = np.array([[c, -s], [s, c]]) @ approach
        half_m = box.half_along_m(way)
        for depth_m in np.arange(_DEEPEST_m, _SHALLOWEST_m - 1e-9, -_DEPTH_STEP_m):
            x, y = np.array([box.x_m, box.y_m]) - (half_m - depth_m) * way
            plan = GraspPlan(GraspFrame(float(x), float(y), yaw_rad), name, height_m)
            if self._was_blocked(plan, float(depth_m)) or not self._is_in_reach(plan, way):
                continue
            if not is_way_clear(plan, self.hand, box):
                continue
            if touches := expected_touches(plan, self.hand, box, surely):
                return SideCandidate(plan, float(depth_m), touches)
        return None

    def _is_in_reach(self, plan: GraspPlan, way: Array) -> bool:
        """Whether the palm stays in the workspace, where the hand comes down beside the object too."""
        palm = plan.frame.pose * closing(plan.closing, plan.height_m, self.hand).grasp_T_palm
        places = np.array([palm.translation()[:2], palm.translation()[:2] - self.reach.standoff_m * way])
        return bool(np.linalg.norm(places - np.array(self.reach.centre_m), axis=1).max() < self.reach.radius_m)

    def _was_blocked(self, plan: GraspPlan, depth_m: float) -> bool:
        """Whether the hand met something on nearly the same way, less than a little deeper."""
        return any(
            plan.closing == other.closing
            and abs(plan.height_m - other.height_m) < _HEIGHT_STEP_m / 2
            and abs(np.sin((plan.frame.yaw_rad - other.frame.yaw_rad) / 2)) < 0.1
            and depth_m > blocked_m - _SHALLOWER_m
            for other, blocked_m in self._blocked
        )

    # --- what it would tell ------------------------------------------------------------------------------------

    def _distances_m(self, places_m: Array) -> Array:
        """Of places (n, 3) to the nearest where a contact was, or was looked for in vain, shape (n,)."""
        looked_m = np.array([*self._points_m, *self._missed_m]).reshape(-1, 3)
        if not len(looked_m):
            return np.full(len(places_m), _FAR_m)
        apart_m = np.linalg.norm(places_m[:, None] - looked_m[None], axis=-1)
        return np.asarray(np.minimum(apart_m.min(axis=1), _FAR_m))

    def _novelty_m(self, touches_m: Array) -> float:
        return float(self._distances_m(touches_m).sum())

    def _tells_something(self, candidate: SideCandidate) -> bool:
        return bool(self._distances_m(candidate.touches_m).max() > _NEAR_m)

    def _is_near_side_new(self, plan: GraspPlan) -> bool:
        """Whether the side that the hand comes from is worth a touch there, and is not tipped over by it."""
        box = self._standing_box()
        way = np.asarray(
            plan.frame.pose.rotation().rotate(np.array(closing(plan.closing, plan.height_m, self.hand).approach))
        )[:2]
        half_m = box.half_along_m(way)
        heights_m = np.arange(plan.height_m, min(plan.height_m + _ROW_m, box.size_m[2]), _ROW_m / 3)
        front = np.array([box.x_m, box.y_m]) - half_m * way
        places_m = np.array([[*front, height_m] for height_m in heights_m])
        slides = float(heights_m.mean()) < half_m / _FRICTION
        return slides and bool(self._distances_m(places_m).mean() > 2 * _NEAR_m)

    @staticmethod
    def _spread(touches_m: Array) -> str:
        low, high = 1e3 * touches_m[:, 2].min(), 1e3 * touches_m[:, 2].max()
        return f"{low:.0f} to {high:.0f} mm"
