"""The hand's grasps on a true surface without physics: kinematics, spherical fingertips, and the rig's measured noise.

The hand descends, lays its fingertips on the top and closes along the same lines as on the rig; a fingertip is a sphere
that stops where it first touches. The effects of physics are drawn at random: fingertips miss their lines, contacts
have noise (:mod:`tactile_lab.experiments.data.sensing`), and a carried object slips in the hand. The closing hand moves
an object that it does not hold: usually little, but often far if a link above the fingertips meets it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import hypot

import numpy as np
from gtsam import Pose2, Pose3, Rot3
from numpy.typing import NDArray

from drivers.core.contacts import FINGERS, ApproachPath, Array, Contact, Grasp, StepSigma
from drivers.core.poses import rotate, spatial, transform_points
from drivers.shadow.closing.closing import closing
from drivers.shadow.closing.collision_spheres import Verdicts, link_balls
from drivers.shadow.closing.posture import PROGRESS, HandShape
from sessions.conductor.estimator import Reorientation
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan, evade, holds
from sessions.motion.probing.touch_patterns import TAP, TAP_HEIGHT_m
from sessions.perception.hand_odometry import HandMotion
from tactile_lab.autonomy.hand_candidates import grasp_time_s, table_of
from tactile_lab.experiments.data.sensing import line_to_contact, measured_contact, planar_pose
from tactile_lab.experiments.data.solids import Solid

PLACE_SIGMA_m = 0.010
BESIDE_SIGMA_m = 0.0015
SLIP_SIGMA_m = 0.005
SLIP_SIGMA_rad = float(np.deg2rad(10.0))
"""The simulated rig shows 1 to 7 mm per axis and 3 to 15 degrees rms while an object is carried, by object."""

NUDGE_SIGMA_m = 0.0005
NUDGE_SIGMA_rad = float(np.deg2rad(0.5))
FELT = StepSigma(0.0005, float(np.deg2rad(1.1)))
"""How well odometry in the hand knows where a carried object lies, root mean square: results of ``carries``."""

PUSH_SIGMA_m = 0.0046
PUSH_SIGMA_rad = float(np.deg2rad(4.5))
PUSHED_SHARE = 0.45
"""How far the closing hand moves an object on the simulated rig, per axis and about its middle: usually little, but by
more than 2 mm or 4 degrees in this share of the grasps in which a link above the fingertips meets the object.
"""

_STEP_m = 0.001
_DESCENT_STEP_m = 0.003


@dataclass(frozen=True)
class Attempt:
    """The result of a planned grasp.

    Attributes:
        plan: the grasp as it was executed; landings shift it.
        landings_world_m: points where fingertips landed on the object, (3,) each.
        grasp: the contacts; None if every approach was blocked.
    """

    plan: GraspPlan
    landings_world_m: list[Array]
    grasp: Grasp | None


class KinematicHand:
    """Executes grasps on an object on the table.

    Args:
        solid: the object; it stands near the world's origin with any yaw.
        cycle: speeds and times of the rig.
        hand: its form, and the shape of its fingertips.
        yaw_window_rad: range of yaw of its arm.
        rng: all random numbers.
        felt: how well its fingertips tell the motion of a carried object; None for a hand that knows its palm's only.
    """

    def __init__(
        self,
        solid: Solid,
        cycle: CycleSettings,
        hand: HandShape,
        yaw_window_rad: tuple[float, float],
        rng: np.random.Generator,
        felt: StepSigma | None = None,
    ) -> None:
        self._felt, self._stated = felt, None if felt is None else _with_nudge(felt)
        self._solid, self._cycle, self._hand, self._window_rad, self._rng = solid, cycle, hand, yaw_window_rad, rng
        self._radius_m = hand.radius_m
        place = planar_pose(rng.normal(0.0, PLACE_SIGMA_m, 2), rng.uniform(-np.pi, np.pi))
        self.world_T_body = spatial(place, -solid.foot_m)
        self.elapsed_s = 0.0
        self._here: GraspFrame | None = None
        self._motion = Pose3()
        self._count = 0

    def attempt(self, plan: GraspPlan) -> Attempt:
        """Tap the top if the plan says so, descend, close and measure."""
        probed = self._tap(plan.frame) if plan.tap else []
        reached, landings = self._descend(plan)
        self.elapsed_s += grasp_time_s(plan, self._cycle, self._here) + len(landings) * self._landing_s
        self._here = plan.frame
        if reached is None:
            return Attempt(plan, landings, None)
        self.world_T_body = self._push(reached) * self.world_T_body
        contacts, lines = self._close(reached)
        palm = reached.frame.pose * table_of(reached, self._hand).grasp_T_palm
        stamp_ns = round(1e9 * self.elapsed_s)
        sigma = None if self._was_left else self._stated
        grasp = Grasp(self._count, stamp_ns, (*contacts, *probed), palm, self._motion, lines, sigma)
        self._count, self._motion = self._count + 1, Pose3()
        return Attempt(reached, landings, grasp)

    def carry(self, wanted: Reorientation, attempt: Attempt) -> HandMotion:
        """Turn and shift the object in the hand, with slip. Does nothing if it is not held, or is to be left in place.

        Returns:
            The object's motion in the world, as the hand knows it, and how well where it felt it.
        """
        assert attempt.grasp is not None
        if not (wanted.moves and holds(attempt.grasp.touching)):
            return HandMotion()
        frame = attempt.plan.frame
        about = np.array([frame.x_m, frame.y_m, 0.0])
        shift = np.append(wanted.shift_world_m, 0.0)
        turned = Rot3.Yaw(wanted.turn_rad)
        motion = Pose3(turned, about + shift - turned.rotate(about))
        middle_m = attempt.grasp.points_world_m.mean(axis=0)
        moved = motion * self._stray(middle_m, SLIP_SIGMA_m, SLIP_SIGMA_rad)
        self.world_T_body = moved * self.world_T_body
        if self._felt is not None:
            motion = moved * self._stray(middle_m, self._felt.translation_m, self._felt.rotation_rad)
        self._motion = motion
        cycle, way_m = self._cycle, float(np.linalg.norm(shift))
        self.elapsed_s += max(abs(wanted.turn_rad) / cycle.carry_turn_rad_s, way_m / cycle.carry_m_s) + cycle.rest_s
        return HandMotion(motion, self._felt)

    @property
    def _landing_s(self) -> float:
        """Time to lift, shift and descend again."""
        cycle = self._cycle
        return cycle.lift_m / cycle.descent_m_s + cycle.lift_m / cycle.travel_m_s + cycle.rest_s

    # --- down --------------------------------------------------------------------------------------------------

    def _descend(self, plan: GraspPlan) -> tuple[GraspPlan | None, list[Array]]:
        """The plan with which the open hand reached the table, and the landings before; None if there was no way
        down.
        """
        table, now, landings = table_of(plan, self._hand), plan, list[Array]()
        landed: set[str] = set()
        for _ in range(self._cycle.landing_tries):
            open_m = np.array([table.path(f).centre_m(table.path(f).valid[0]) for f in FINGERS])
            places, met = self._coming_down(transform_points(now.frame.pose, open_m), plan.height_m)
            if not met.any():
                return now, landings
            level = int(met.any(axis=1).argmax())
            hit = [finger for finger, meets in zip(FINGERS, met[level], strict=True) if meets]
            landings.append(places[level, FINGERS.index(hit[0])])
            landed.update(hit)
            now = evade(plan, now, hit, landed, table, self._cycle.landing_shift_m, self._window_rad)
        return None, landings

    def _tap(self, frame: GraspFrame) -> list[Contact]:
        """Lay the fingertips on what is below: all fingers that reach it when the first one has met it."""
        table, touch = closing(TAP.closing, TAP_HEIGHT_m, self._hand), self._cycle.touch
        above_m = np.array([table.path(finger).centre_m(TAP.progress[finger]) for finger in FINGERS])
        above_m = self._beside(transform_points(frame.pose, above_m))
        places, met = self._coming_down(above_m, touch.lowest_m + self._radius_m)
        if not met.any():
            return []
        levels = np.where(met.any(axis=0), met.argmax(axis=0), len(met))
        reach_m = np.where(np.array(FINGERS) == "TH", 0.0, touch.reach_m) + touch.sink_m
        found = []
        for index, finger in enumerate(FINGERS):
            if (levels[index] - levels.min()) * _DESCENT_STEP_m <= reach_m[index]:
                found.append(replace(self._measure(finger, places[levels[index], index]), probed=True))
        return found

    def _coming_down(self, centres_world_m: Array, lowest_m: float) -> tuple[Array, Verdicts]:
        """Positions (n, 5, 3) of fingertips on their way down, the lowest one to ``lowest_m``, and which of them touch
        (n, 5).
        """
        heights_m = np.arange(self._cycle.lift_m + lowest_m, lowest_m - 1e-9, -_DESCENT_STEP_m)
        places = np.repeat(centres_world_m[None], len(heights_m), axis=0)
        places[:, :, 2] += heights_m[:, None] - centres_world_m[:, 2].min()
        return places, self._distances(places) < self._radius_m

    # --- close -------------------------------------------------------------------------------------------------

    def _close(self, plan: GraspPlan) -> tuple[list[Contact], tuple[ApproachPath, ...]]:
        places, ways = self._closing(plan)
        starts = places[0]
        stops, touched = self._stops(places)
        ends = places[stops, np.arange(5)]
        contacts = [self._measure(f, end) for f, end, meets in zip(FINGERS, ends, touched, strict=True) if meets]
        measured = {contact.finger: contact for contact in contacts}
        lines = []
        for finger, start, end, way in zip(FINGERS, starts, ends, ways, strict=True):
            foremost = start + self._radius_m * way
            if finger in measured:
                lines.append(line_to_contact(foremost, measured[finger]))
            else:
                lines.append(ApproachPath(finger, foremost, end + self._radius_m * way, touched=False))
        return contacts, tuple(lines)

    def _closing(self, plan: GraspPlan) -> tuple[Array, Array]:
        """Positions (n, 5, 3) that the fingertips' centres would pass, step by step, and their directions (5, 3),
        world.
        """
        paths = [table_of(plan, self._hand).path(finger) for finger in FINGERS]
        starts = self._beside(transform_points(plan.frame.pose, np.array([p.centre_m(p.valid[0]) for p in paths])))
        ways = rotate(plan.frame.pose, np.array([path.direction for path in paths]))
        lengths = np.array([path.length_m * float(np.ptp(path.valid)) for path in paths])
        steps_m = np.minimum(np.arange(0.0, lengths.max() + _STEP_m, _STEP_m)[:, None], lengths)
        return starts + steps_m[..., None] * ways, ways

    def _links_meet(self, plan: GraspPlan) -> bool:
        """Whether a link above the fingertips enters the object before all of them have come to rest."""
        balls = link_balls(plan.closing, plan.height_m, self._hand)
        paths = [table_of(plan, self._hand).path(finger) for finger in FINGERS]
        ways_m = _STEP_m * self._stops(self._closing(plan)[0])[0]
        ends = [path.valid[0] + way_m / path.length_m for path, way_m in zip(paths, ways_m, strict=True)]
        distances_m = self._distances(transform_points(plan.frame.pose, balls.centres_m))
        return bool(balls.collides(distances_m, PROGRESS[:, None] < ends))

    def _stops(self, places: Array) -> tuple[NDArray[np.intp], Verdicts]:
        """Step at which each finger stops, and whether it stops on the object; all fingers close together."""
        meets = self._distances(places) < self._radius_m
        stops, touched, moving = np.zeros(5, dtype=np.intp), np.zeros(5, dtype=bool), np.ones(5, dtype=bool)
        for step in range(len(places)):
            stops[moving] = step
            touched |= moving & meets[step]
            now = places[stops, np.arange(5)]
            gaps = np.linalg.norm(now[:4] - now[4], axis=1)
            near = np.append(gaps, gaps.min()) < self._cycle.finger_gap_m
            moving &= ~touched & ~near
        return stops, touched

    @property
    def _was_left(self) -> bool:
        return bool(self._motion.equals(Pose3(), 1e-9))

    # --- random effects -----------------------------------------------------------------------------------------

    def _beside(self, centres_world_m: Array) -> Array:
        """The true paths of the fingertips, beside their lines."""
        aside = np.zeros_like(centres_world_m)
        aside[:, :2] = self._rng.normal(0.0, BESIDE_SIGMA_m, (len(aside), 2))
        return np.asarray(centres_world_m + aside)

    def _push(self, plan: GraspPlan) -> Pose3:
        """Move the object by the closing hand; the error of a carried object is in its slip."""
        far = self._was_left and self._links_meet(plan) and bool(self._rng.random() < PUSHED_SHARE)
        sigmas = (PUSH_SIGMA_m, PUSH_SIGMA_rad) if far else (NUDGE_SIGMA_m, NUDGE_SIGMA_rad)
        return self._stray(np.asarray(self.world_T_body.translation()), *sigmas)

    def _stray(self, middle_world_m: Array, sigma_m: float, sigma_rad: float) -> Pose3:
        """A random displacement of the object in the world, with a rotation about a given point."""
        x, y, turn = self._rng.normal(size=3) * [sigma_m, sigma_m, sigma_rad]
        about = Pose3(Rot3(), middle_world_m)
        return about * spatial(Pose2(x, y, turn)) * about.inverse()

    def _measure(self, finger: str, centre_world_m: Array) -> Contact:
        """The contact of a fingertip at a position: the point of the surface nearest to its centre."""
        centre = transform_points(self.world_T_body.inverse(), centre_world_m[None])
        _, places = self._solid.nearest(centre)
        normal = centre[0] - places[0]
        return measured_contact(finger, places[0], normal / np.linalg.norm(normal), self.world_T_body, self._rng)

    def _distances(self, places_world_m: Array) -> Array:
        """Distances of fingertips' centres (..., 3) to the surface."""
        flat = transform_points(self.world_T_body.inverse(), places_world_m.reshape(-1, 3))
        return self._solid.nearest(flat)[0].reshape(places_world_m.shape[:-1])


def _with_nudge(felt: StepSigma) -> StepSigma:
    """What is known of a carry, once the hand has closed again."""
    return StepSigma(hypot(felt.translation_m, NUDGE_SIGMA_m), hypot(felt.rotation_rad, NUDGE_SIGMA_rad))
