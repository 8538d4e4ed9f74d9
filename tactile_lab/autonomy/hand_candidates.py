"""Feasible grasps of the hand around the estimated object, and why others are infeasible.

A candidate is a grasp frame (every yaw of the arm's window, shifts across it), a closing, a height of the fingertips
and, where a surface is wanted, perhaps a tap on the top before it (in the middle, and near the ends of a long object),
or a hand that leans to one side. Its expected
contacts follow from the kinematics: round fingertips on the closing's lines against the estimated surface. A grasp is
infeasible if the arm cannot reach it, if the open fingers would land on the object or the palm rest on it, or if the
hand has just landed there. A grasp that would push the object with a link without sensors is marked.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from gtsam import Pose2

from drivers.core.contacts import Array
from drivers.shadow.closing.closing import Closing, closing
from drivers.shadow.closing.collision_spheres import Verdicts
from drivers.shadow.closing.posture import HandShape
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.probing.touch_patterns import TAP, TAP_HEIGHT_m
from sessions.motion.safety import SafetySettings
from tactile_lab.autonomy.clearance.collision_check import links_are_clear, standing
from tactile_lab.autonomy.heuristic_planner import HasRoom, PlanSettings, anywhere
from tactile_lab.autonomy.variance_planner import ExplorationSettings, KnownShape, closing_rays
from tactile_lab.slam.exploration.candidates import Candidate, ClosingRays
from tactile_lab.slam.tracking.contacts.contact_set import planar_rotation

_TAP_FROM_m = 0.025
"""Height above the object's top at which the rays of a tap start."""

_TAP_HALF_m = 0.025
"""From the middle of a tap to the edge of the top: its fingertips stand in a circle of 30 mm, 10 mm from the edge."""

_PALM_THICKNESS_m = 0.030
"""Extent of the palm below its origin, which the object's top must not reach."""

_DESCENT_STEP_m = 0.010
_OWN_TIME_s = 1.6  # opening, closing and waiting for motors, beside what the settings tell

OUT_OF_REACH = "the arm does not reach there"
NO_ROOM = "no room for the open hand"
TOO_TALL = "the object is as high as the palm"
TOO_HIGH = "the fingers would close above the object"
LANDED = "the hand has just landed there, or the bounding box is in the way"


@dataclass(frozen=True)
class HandCandidate:
    """A grasp for the hand, and its form for policies."""

    plan: GraspPlan
    candidate: Candidate


@dataclass(frozen=True)
class Offer:
    """All feasible grasps, and the number of plans excluded by each obstacle."""

    usable: tuple[HandCandidate, ...]
    ruled_out: Mapping[str, int]

    @property
    def obstacles(self) -> str:
        """Why the others are infeasible."""
        return ", ".join(f"{count}: {reason}" for reason, count in self.ruled_out.items())


@dataclass(frozen=True)
class HandLimits:
    """Limits of the candidates of a session."""

    plan: PlanSettings
    exploration: ExplorationSettings
    cycle: CycleSettings
    safety: SafetySettings
    hand: HandShape
    dimension: int

    @property
    def heights_m(self) -> tuple[float, ...]:
        """Contact heights."""
        return self.plan.contour_heights_m if self.dimension == 2 else self.plan.surface_heights_m

    @property
    def side_closings(self) -> tuple[str, ...]:
        """Closings with the hand leaning; none for a contour, which has a single height."""
        return () if self.dimension == 2 else self.exploration.side_closings


def offer(
    limits: HandLimits,
    known: KnownShape,
    world_T_object: Pose2,
    here: GraspFrame | None = None,
    has_room: HasRoom = anywhere,
) -> Offer:
    """The candidates around an object that is expected at ``world_T_object``.

    Args:
        limits: of the hand.
        known: the object's shape as estimated.
        world_T_object: its expected pose in the table plane.
        here: present pose of the hand, for the travel time; None if unknown.
        has_room: further obstacles of a plan (such as a place where the hand has just landed).
    """
    plans = list(_plans(limits, known, world_T_object))
    ruled_out: Counter[str] = Counter()
    tests: list[tuple[str, Callable[[Sequence[GraspPlan]], Verdicts]]] = [
        (OUT_OF_REACH, lambda some: np.array([_reachable(plan, limits) for plan in some])),
        (LANDED, lambda some: np.array([has_room(plan) for plan in some])),
        (TOO_TALL, lambda some: np.array([_palm_is_clear(plan, limits, known) for plan in some])),
        (TOO_HIGH, lambda some: np.array([_is_below_top(plan, known) for plan in some])),
        (NO_ROOM, lambda some: _tips_are_clear(some, limits, known, world_T_object)),
    ]
    for reason, test in tests:
        passed = test(plans) if plans else np.empty(0, dtype=bool)
        if failed := int(np.count_nonzero(~passed)):
            ruled_out[reason] += failed
        plans = [plan for plan, fine in zip(plans, passed, strict=True) if fine]
    tap_from_m = (known.top_height_m or 0.0) + _TAP_FROM_m
    rays_of = cache(partial(_rays, limits, tap_from_m))  # yaws and shifts of one closing share them
    marked = zip(plans, _pushing(plans, limits, known, world_T_object), strict=True)
    usable = tuple(_as_candidate(plan, limits, here, rays_of, bool(pushes)) for plan, pushes in marked)
    return Offer(usable, dict(ruled_out))


def _plans(limits: HandLimits, known: KnownShape, world_T_object: Pose2) -> Iterator[GraspPlan]:
    """Every combination; taps only at one height, as the others would be equal."""
    shifts, heights = limits.exploration.shifts_m, limits.heights_m
    centre_world_m = np.asarray(world_T_object.transformFrom(known.centre_m))
    for yaw in np.linspace(*limits.plan.yaw_window_rad, limits.exploration.yaws):
        tapped = _tapped_shifts(limits, known, float(yaw - world_T_object.theta()))
        for shift in shifts:
            x, y = centre_world_m + planar_rotation(float(yaw)) @ np.array([0.0, shift])
            frame = GraspFrame(float(x), float(y), float(yaw))
            for name in limits.plan.closings:
                for height_m in heights:
                    plan = GraspPlan(frame, name, height_m)
                    yield plan
                    if shift in tapped and height_m == heights[0]:
                        yield replace(plan, tap=True)
            for name in limits.side_closings:
                for height_m in limits.exploration.side_heights_m:
                    yield GraspPlan(frame, name, height_m)


def _tapped_shifts(limits: HandLimits, known: KnownShape, yaw_rad: float) -> set[float]:
    """Where the hand taps: in the middle, and as far aside as it shifts where the object is longer than that.

    Args:
        limits: of the hand.
        known: the object's shape as estimated.
        yaw_rad: of the hand in the object frame.
    """
    if limits.dimension == 2:
        return set()
    shifts = limits.exploration.shifts_m
    tapped = {shifts[len(shifts) // 2]}
    if known.surface is None:
        return tapped
    aside_m = (known.surface.points_m[:, :2] - known.centre_m) @ planar_rotation(yaw_rad)[:, 1]
    ends = {end for end in (min(shifts), max(shifts)) if (np.sign(end) * aside_m).max() > abs(end) + _TAP_HALF_m}
    return tapped | ends


def table_of(plan: GraspPlan, hand: HandShape) -> Closing:
    """The closing of a plan."""
    return closing(plan.closing, plan.height_m, hand)


def _reachable(plan: GraspPlan, limits: HandLimits) -> bool:
    """Whether the palm stays in the workspace that the safety supervisor watches."""
    palm = plan.frame.pose * table_of(plan, limits.hand).grasp_T_palm
    centre = np.array(limits.safety.workspace_centre_m)
    return float(np.linalg.norm(np.asarray(palm.translation())[:2] - centre)) < limits.safety.workspace_radius_m


def _palm_is_clear(plan: GraspPlan, limits: HandLimits, known: KnownShape) -> bool:
    if known.top_height_m is None:
        return True
    return float(table_of(plan, limits.hand).grasp_T_palm.z()) - _PALM_THICKNESS_m > known.top_height_m


def _is_below_top(plan: GraspPlan, known: KnownShape) -> bool:
    return known.top_height_m is None or plan.height_m < known.top_height_m


def _tips_are_clear(plans: Sequence[GraspPlan], limits: HandLimits, known: KnownShape, pose: Pose2) -> Verdicts:
    """Whether the open fingertips come down clear of the estimated surface, all the way, and of its uncertainty."""
    starts_m = np.array([_open_tips_m(plan, limits.hand) for plan in plans])
    turn, place = planar_rotation(float(pose.theta())), np.array([pose.x(), pose.y()])
    flat_m = (starts_m[..., :2] - place) @ turn
    if known.dimension == 2:
        places_m = flat_m[:, None]
    else:
        highest_m = max(known.top_height_m or 0.0, 0.0) + limits.exploration.clearance_m
        above_m = np.arange(0.0, max(highest_m - starts_m[..., 2].min(), _DESCENT_STEP_m), _DESCENT_STEP_m)
        heights_m = starts_m[:, None, :, 2] + above_m[None, :, None] - known.origin_height_m
        level_m = np.broadcast_to(flat_m[:, None], (*heights_m.shape, 2))
        places_m = np.concatenate([level_m, heights_m[..., None]], axis=-1)
    clear = _are_clear(places_m.reshape(-1, known.dimension), limits.exploration, known)
    return np.asarray(clear.reshape(len(plans), -1).all(axis=1))


def _are_clear(places_m: Array, settings: ExplorationSettings, known: KnownShape) -> Verdicts:
    """Which points are clear of the surface; its expensive uncertainty is computed only where it matters."""
    spare_m = known.field.predict(places_m).mean_m - settings.clearance_m
    clear = spare_m > settings.caution * settings.clearance_m
    decisive = (spare_m > 0.0) & ~clear
    if decisive.any():
        sigma_m = np.minimum(np.sqrt(known.field.variance(places_m[decisive])), settings.clearance_m)
        clear[decisive] = spare_m[decisive] > settings.caution * sigma_m
    return np.asarray(clear)


def _pushing(plans: Sequence[GraspPlan], limits: HandLimits, known: KnownShape, world_T_object: Pose2) -> Verdicts:
    """Which plans have a link above the fingertips in the object."""
    target = standing(known, world_T_object, limits.plan.contour_top_m)
    if target is None:
        return np.zeros(len(plans), dtype=bool)
    return ~links_are_clear(plans, limits.hand, target)


def _open_tips_m(plan: GraspPlan, hand: HandShape) -> Array:
    """Centres of the open hand's tips, world frame, shape (fingers, 3)."""
    paths = table_of(plan, hand).paths
    return np.array([plan.frame.pose.transformFrom(paths[f].centre_m(paths[f].valid[0])) for f in paths])


# --- what policies see ---------------------------------------------------------------------------------------------


def _as_candidate(
    plan: GraspPlan, limits: HandLimits, here: GraspFrame | None, rays_of: Callable[..., ClosingRays], pushes: bool
) -> HandCandidate:
    frame, rays = plan.frame, rays_of(plan.closing, plan.height_m, plan.tap)
    pose = Pose2(frame.x_m, frame.y_m, frame.yaw_rad)
    return HandCandidate(plan, Candidate(pose, plan.closing, rays, grasp_time_s(plan, limits.cycle, here), pushes))


def _rays(limits: HandLimits, tap_from_m: float, name: str, height_m: float, tap: bool) -> ClosingRays:
    rays = closing_rays(closing(name, height_m, limits.hand))
    return _with_tap(rays, tap, tap_from_m, limits.hand) if limits.dimension == 3 else rays


def _with_tap(rays: ClosingRays, taps: bool, from_m: float, hand: HandShape) -> ClosingRays:
    """The rays followed by those of a tap; without a tap these have length zero, for equal numbers."""
    table = closing(TAP.closing, TAP_HEIGHT_m, hand)
    above_m = np.array([table.path(finger).centre_m(TAP.progress[finger]) for finger in table.fingers])
    above_m[:, 2] = from_m
    return ClosingRays(
        fingers=(*rays.fingers, *table.fingers),
        starts_m=np.vstack([rays.starts_m, above_m]),
        directions=np.vstack([rays.directions, np.tile([0.0, 0.0, -1.0], (len(above_m), 1))]),
        lengths_m=np.append(rays.lengths_m, np.full(len(above_m), from_m if taps else 0.0)),
        radius_m=rays.radius_m,
    )


def grasp_time_s(plan: GraspPlan, cycle: CycleSettings, here: GraspFrame | None) -> float:
    """Duration of a grasp from the hand's present pose until the object is released."""
    travel_s = 0.0
    if here is not None:
        way_m = float(np.hypot(plan.frame.x_m - here.x_m, plan.frame.y_m - here.y_m))
        turn_rad = abs(plan.frame.yaw_rad - here.yaw_rad)
        travel_s = max(way_m / cycle.travel_m_s, turn_rad / cycle.turn_rad_s)
    down_and_up_s = cycle.lift_m / cycle.descent_m_s + cycle.lift_m / cycle.travel_m_s
    closing_s = 0.05 / cycle.closing_m_s
    rests_s = 4 * cycle.rest_s + cycle.settle_s + cycle.capture_s + cycle.squeeze_s
    return travel_s + down_and_up_s + closing_s + rests_s + _OWN_TIME_s + (tap_time_s(cycle) if plan.tap else 0.0)


def tap_time_s(cycle: CycleSettings) -> float:
    """Additional duration of a tap on the top before a grasp."""
    touch = cycle.touch
    moving_s = cycle.lift_m / touch.tap_m_s + cycle.lift_m / cycle.travel_m_s
    return moving_s + cycle.rest_s + touch.press_s + touch.capture_s + _OWN_TIME_s / 2
