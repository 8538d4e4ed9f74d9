"""The grasp cycle: descend, close, settle, capture, squeeze, re-orient, release, lift."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array, Grasp
from drivers.shadow.closing.closing import SIDES, Closing, closing
from drivers.shadow.closing.hand_envelope import lowest_inside_m, open_hand
from drivers.shadow.closing.posture import HandShape
from sessions.motion.carry_guard import CarryGuard, cycles_evenly_along
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_fingers import GraspFingers
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan, evade
from sessions.motion.guard import Guard
from sessions.motion.holding import HoldingForces
from sessions.motion.motion import Motion
from sessions.motion.probing.side_survey import LOW_m
from sessions.motion.probing.touching import SideTouch, Toucher
from sessions.motion.travel import travel_height_m
from sessions.motion.weighing import Grip, LiftEnd, Weigher
from sessions.perception.carrying.forecast import Forecast, IntendedCarry
from sessions.perception.carrying.slip import Slip

_LEAST_HOLD_N = 0.1
"""A fingertip that presses less holds nothing."""

_LINKS_NEAR_m = 0.005
"""Above a top that is known on: from there links may land on it."""

_BELOW_TOP_m = 0.012
"""So far at least the fingertips' centres stay below it where a grasp is tried again higher."""


class GraspCycle:
    """The steps of one grasp, in the order in which they are called.

    Args:
        motion: supervised motion.
        settings: speeds, forces, times.
        hand: its form, and the shape of its fingertips.
        yaw_window_rad: yaws the arm can reach.
    """

    def __init__(
        self,
        motion: Motion,
        settings: CycleSettings,
        hand: HandShape | None = None,
        yaw_window_rad: tuple[float, float] = (-np.pi, np.pi),
    ) -> None:
        self._motion, self.settings = motion, settings
        self._toucher = Toucher(motion, settings, hand or HandShape())
        self._guard = Guard(motion, settings.touch.met_N, settings.held_up_rad)
        self._landing = Guard(motion, settings.landing_force_N, settings.held_up_rad)
        self._hand, self._yaw_window_rad = hand or HandShape(), yaw_window_rad
        self._plan: GraspPlan | None = None
        self.fingers = GraspFingers(motion, settings, self._hand)
        """Close, hold and open."""

        self.landings_world_m: list[Array] = []
        """Centres of the tips, (3,) each, at each landing on the object in the last approach."""

        self.holding_N = settings.squeeze_force_N
        """Force of each finger while the object is carried; :meth:`forecast` fits it to what is known of the object."""

        self.jammed: tuple[str, ...] = ()
        """The fingertips that were pressed so hard in the last re-orientation that it stopped early."""

        self.slipped: Slip | None = None
        """The slip at which the last re-orientation stopped early."""

    @property
    def _fingers(self) -> tuple[str, ...]:
        return self._hand.form.fingers

    @property
    def plan(self) -> GraspPlan:
        """The current grasp at its actual position (a landing or a re-orientation shifts it)."""
        assert self._plan is not None
        return self._plan

    # --- down --------------------------------------------------------------------------------------------------

    def descend(self, plan: GraspPlan) -> bool:
        """Move above, tap on the top if the plan says so, tare, and descend guarded.

        A fingertip that touches something during the descent has landed on the object: lift, shift the grasp toward
        that finger and try again. If thumb and fingers have both landed, the object is too long in that direction:
        turn.

        Returns:
            Whether the hand has descended around the object, fingers open; after a touch alone, whether there was room
            for it: the hand has risen again, and only :meth:`capture` may follow.
        """
        self._plan, self.landings_world_m = plan, []
        if plan.only_touch:
            return self._touch(plan)
        if self._table().is_sideways:
            return self._come_from_the_side()
        landed: set[str] = set()
        if plan.tap:
            self._toucher.tap(plan.frame)
        for _ in range(self.settings.landing_tries):
            self._move_above()
            hit = self._come_down()
            if not hit:
                self._motion.supervisor.on_approach()
                return True
            up_m = self._short_of_m()
            self.lift()
            if (again := self._otherwise(plan, hit, landed, up_m)) is None:
                return False
            self._plan = again
        return False

    def _short_of_m(self) -> float:
        """How far above the grasp the hand is."""
        down = self._motion.base_joints(self.plan.frame, self._table())
        return float(np.linalg.norm(down[:3] - self._motion.runtime.perception.hand.base_q[:3]))

    def _otherwise(self, plan: GraspPlan, hit: tuple[str, ...], landed: set[str], up_m: float) -> GraspPlan | None:
        """The plan after a landing ``up_m`` above the grasp: where only links did, which would land again a little
        aside, so much higher; otherwise as :func:`evade` says. None where that may not be.
        """
        s = self.settings
        if not (fingers := [finger for finger in hit if finger in self._fingers]):
            top_m = self._motion.tallest_m or np.inf
            return self.plan.raised(up_m, top_m - _BELOW_TOP_m)
        if not plan.may_shift:
            return None
        landed.update(fingers)
        return evade(plan, self.plan, fingers, landed, self._table(), s.landing_shift_m, self._yaw_window_rad)

    def _touch(self, plan: GraspPlan) -> bool:
        """Only touch, and rise again."""
        if not self._table().is_sideways:
            self._toucher.tap(plan.frame, self.settings.touch.below_top_m)
            return True
        felt = self._touch_side(plan)
        if felt is None:
            self._note_landing(self._toucher.guard)
        return felt is not None

    def _touch_side(self, plan: GraspPlan) -> SideTouch | None:
        """Touch the side that a grasp from the side comes from."""
        side = next(side for side in SIDES if plan.closing.endswith(side))
        low_m, beyond_m = (LOW_m, self.settings.touch.past_side_m) if plan.only_touch else (0.0, 0.0)
        return self._toucher.touch_side(plan.frame, side, self.settings.standoff_m, plan.height_m, low_m, beyond_m)

    def _move_above(self) -> None:
        s = self.settings
        self._motion.climb(self._above(), s.travel_m_s)
        self.fingers.open_for(self._table())
        self._motion.move_base(self._above(), s.travel_m_s, s.turn_rad_s)
        self._motion.tare(s.rest_s)

    def _above(self) -> Array:
        """Where the hand may travel, above the grasp or, from the side, above where it descends next to the object."""
        table = self._table()
        above_m = travel_height_m(table, self._motion, self.settings, self._hand)
        return self._motion.base_joints(self.plan.frame, table, above_m, self._away_m)

    @property
    def _away_m(self) -> float:
        """How far back along the approach the hand comes down and goes up."""
        return self.settings.standoff_m if self._table().is_sideways else 0.0

    def _come_from_the_side(self) -> bool:
        """Down next to the object, then slowly toward it; back and up again if the hand hits something.

        A contact of a fingertip on the way in is captured as a touch.
        """
        s, motion, table = self.settings, self._motion, self._table()
        if self.plan.tap:
            self._touch_side(self.plan)
        self._move_above()
        self._guard.restart()
        beside = motion.base_joints(self.plan.frame, table, 0.0, self._away_m)
        if not motion.probe_base(beside, s.beside_m_s, self._guard.is_met):
            self._note_landing(self._guard)
            motion.climb(self._above(), s.travel_m_s)
            return False
        motion.tare(s.rest_s)
        self._guard.restart()
        motion.runtime.begin_closing()
        for q in motion.line(motion.base_joints(self.plan.frame, table), s.approach_m_s):
            motion.set_base(q)
            motion.tick()
            if self._guard.is_met():
                motion.set_base(motion.runtime.perception.hand.base_q)
                self._note_landing(self._guard)
                self._toucher.capture()
                self.lift()
                return False
        motion.supervisor.on_approach()
        return True

    def _note_landing(self, guard: Guard) -> None:
        """Store where the hand hit something: at the fingertip that did, or else at the foremost."""
        fingers = [finger for finger in guard.met if finger in self._fingers] or list(self._fingers)
        ahead = np.asarray(self.plan.frame.pose.rotation().rotate(np.array(self._table().approach)))
        places = [self._motion.tip_centre_world_m(finger, self._hand) for finger in fingers]
        self.landings_world_m.append(max(places, key=lambda place: float(place @ ahead)))

    def _note_landing_from_above(self, guard: Guard, link_m: float) -> None:
        """Store where the hand landed; links alone, the lowest of which is at ``link_m``, do so between the fingertips,
        which passed by.
        """
        if np.isinf(link_m) or any(finger in self._fingers for finger in guard.met):
            self._note_landing(guard)
            return
        frame = self.plan.frame
        self.landings_world_m.append(np.array([frame.x_m, frame.y_m, link_m + self._short_of_m()]))

    def _come_down(self) -> tuple[str, ...]:
        """Guarded descent, slower from the object's top on, and slowest where links may land on it.

        Returns:
            What landed on something: fingers, or unidentified links.
        """
        s, guard, motion, table = self.settings, self._landing, self._motion, self._table()
        hand = table.name, table.height_m, self._hand
        inside_m = lowest_inside_m(*hand)
        tips_m = max(0.0, motion.tallest_m + s.touch.near_m - open_hand(*hand).lowest_m)
        links_m = np.clip(motion.tallest_m + _LINKS_NEAR_m - inside_m, 0.0, tips_m)
        for above_m, speed_m_s in ((tips_m, s.descent_m_s), (links_m, s.landing_m_s), (0.0, s.links_landing_m_s)):
            guard.restart()
            if not motion.probe_base(motion.base_joints(self.plan.frame, table, above_m), speed_m_s, guard.is_met):
                motion.wait(s.rest_s)
                guard.is_met()
                self._note_landing_from_above(guard, inside_m)
                break
        return guard.met

    # --- close and measure -------------------------------------------------------------------------------------

    def close(self) -> None:
        """Close every finger until it touches; see :meth:`GraspFingers.close`."""
        self.fingers.close()

    def settle(self) -> None:
        """Bring the fingers that touch to the contact force, then let hand and object come to rest."""
        self.fingers.settle()

    def capture(self) -> Grasp:
        """Collect samples, compute a grasp from them, and take a picture of the held object."""
        return self._motion.capture(self.settings.capture_s)

    # --- carry -------------------------------------------------------------------------------------------------

    def forecast(self, grasp: Grasp, turn_rad: float, shift_world_m: Array) -> Forecast | None:
        """What will become of the object in this carry, which is then held as hard as it needs; None if its friction on
        the table was not measured: then it is held with the usual force.
        """
        s, odometry = self.settings, self._motion.runtime.perception.held.odometry
        self.holding_N = s.squeeze_force_N
        if odometry.measured.table_N is None:
            return None

        def balanced_N(force_N: float) -> dict[str, float]:
            return self.fingers.balanced_forces_N(grasp.touching, force_N)

        contacts = [contact for contact in grasp.contacts if contact.finger in grasp.touching]
        start, end = (frame.planar for frame in (self.plan.frame, self._carried_to(1.0, turn_rad, shift_world_m)))
        duration_s = self._carry_s(turn_rad, shift_world_m)
        intended = IntendedCarry.of(contacts, start, end, duration_s, s.squeeze_gain)
        grip = HoldingForces(balanced_N, s.holding, s.squeeze_force_N, s.pressed_N)
        forecast = grip.choose(intended, odometry)
        self.holding_N = forecast.force_N
        return forecast

    def _carried_to(self, share: float, turn_rad: float, shift_world_m: Array) -> GraspFrame:
        dx, dy = share * shift_world_m
        return self.plan.frame.move(float(dx), float(dy), share * turn_rad)

    def _carry_s(self, turn_rad: float, shift_world_m: Array) -> float:
        s = self.settings
        return max(abs(turn_rad) / s.carry_turn_rad_s, float(np.linalg.norm(shift_world_m)) / s.carry_m_s)

    def squeeze(self, touching: frozenset[str]) -> None:
        """Build up the holding force of the fingers that touch; the thumb holds against their sum."""
        targets_N = self.fingers.balanced_forces_N(touching, self.holding_N)
        self.fingers.build_up(targets_N, self.settings.squeeze_s)

    def reorient(self, turn_rad: float, shift_world_m: Array, touching: frozenset[str]) -> Pose3:
        """Turn about the grasp's vertical axis and shift while holding the object, as far as it is neither jammed
        (:attr:`jammed`) nor slips (:attr:`slipped`).

        Args:
            turn_rad: about world z.
            shift_world_m: shape (2,), along the world's axes.
            touching: fingers that hold.

        Returns:
            The measured motion of the palm in the world, which carries the object (eq. 3.8).
        """
        motion, table = self._motion, self._table()
        targets_N = self.fingers.balanced_forces_N(touching, self.holding_N)
        world_T_before = motion.runtime.perception.hand.world_T_palm
        motion.runtime.begin_hold()
        begun_ns, held = motion.runtime.clock.now_ns(), motion.runtime.perception.held
        duration_s = self._carry_s(turn_rad, shift_world_m)
        asked = cycles_evenly_along(motion.path_cycles(duration_s), round(duration_s / self.settings.slip_check_s))
        guard = CarryGuard(self.fingers, targets_N, self.settings, asked, lambda: held.slip_since(begun_ns))

        def base_at(share: float) -> Array:
            return motion.base_joints(self._carried_to(share, turn_rad, shift_world_m), table)

        share = motion.follow(base_at, duration_s, guard.hold)
        self.jammed, self.slipped = guard.jammed, guard.slipped
        if self.jammed:
            self.fingers.build_up(targets_N, self.settings.squeeze_s)
        motion.wait(self.settings.rest_s)
        self.fingers.ease(touching, self.holding_N)
        motion.runtime.end_hold()
        self._plan = replace(self.plan, frame=self._carried_to(share, turn_rad, shift_world_m))
        return motion.runtime.perception.hand.world_T_palm * world_T_before.inverse()

    def weigh(self, touching: frozenset[str]) -> LiftEnd:
        """Drag, lift and set down the object that these fingers hold; the runtime's perception knows what was found."""
        unit_N = max(self.fingers.balanced_forces_N(touching, 1.0).values())
        grip = Grip(
            hold=lambda force_N: self.fingers.servo_forces(self.fingers.balanced_forces_N(touching, force_N)),
            share_pressed=lambda share: share * self.settings.pressed_N / unit_N,
            holding=lambda: frozenset(self.fingers.pressed(_LEAST_HOLD_N)),
            is_pressed=lambda: bool(self.fingers.pressed(self.settings.pressed_N)),
        )
        end = Weigher(self._motion, self.settings.weighing, grip).weigh(self.plan.frame, self._table())
        if end.is_held:
            self.fingers.ease(touching, self.settings.weighing.squeeze_N)
        self._motion.runtime.end_hold()
        return end

    # --- and away ----------------------------------------------------------------------------------------------

    def release(self) -> None:
        """Open the hand; see :meth:`GraspFingers.release`."""
        self.fingers.release()

    def lift(self) -> None:
        """Back along the approach, where the hand came from the side, then straight up."""
        s, motion = self.settings, self._motion
        if self._away_m:
            motion.move_base(motion.base_joints(self.plan.frame, self._table(), 0.0, self._away_m), s.travel_m_s, 1.0)
        motion.move_base(self._above(), s.travel_m_s, s.turn_rad_s)

    def idle(self) -> None:
        """One cycle without motion."""
        self._motion.tick()

    def _table(self) -> Closing:
        return closing(self.plan.closing, self.plan.height_m, self._hand)
