"""The grasp cycle: descend, close, settle, capture, squeeze, re-orient, release, lift."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array, Grasp
from drivers.shadow.closing.closing import SIDES, Closing, closing
from drivers.shadow.closing.posture import HandShape
from sessions.motion.arrival import Arrival, Place
from sessions.motion.carry_guard import CarryGuard, cycles_evenly_along
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_fingers import GraspFingers
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan, TouchPlace, evade
from sessions.motion.holding import HoldingForces
from sessions.motion.lift import Lift, LiftEnd
from sessions.motion.motion import Motion
from sessions.motion.probing.one_finger import OneFingerToucher
from sessions.motion.probing.touching import SideTouch
from sessions.motion.travel import travel_height_m
from sessions.motion.weighing import Grip, Weigher
from sessions.perception.carrying.forecast import Forecast, IntendedCarry
from sessions.perception.carrying.slip import Slip

_LEAST_HOLD_N = 0.1
"""A fingertip that presses less holds nothing."""

_BESIDE_m, _BESIDE_m_s = 0.05, 0.05
"""So far up the hand may be beside the object that it let go, and how fast it rises there: a fingertip pressed with
2 N at the speed of travel, with 0.6 N at this one.
"""

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
        self._toucher = OneFingerToucher(motion, settings, hand or HandShape())
        self._arrival = Arrival(motion, settings, hand or HandShape())
        self._hand, self._yaw_window_rad = hand or HandShape(), yaw_window_rad
        self._plan: GraspPlan | None = None
        self.fingers = GraspFingers(motion, settings, self._hand)
        """Close, hold and open."""

        self.holding_N = settings.squeeze_force_N
        """Force of each finger while the object is carried; :meth:`forecast` fits it to what is known of the object."""

        self.jammed: tuple[str, ...] = ()
        """The fingertips that were pressed so hard in the last re-orientation that it stopped early."""

        self.slipped: Slip | None = None
        """The slip at which the last re-orientation stopped early."""

    @property
    def plan(self) -> GraspPlan:
        """The current grasp at its actual position (a landing or a re-orientation shifts it)."""
        assert self._plan is not None
        return self._plan

    @property
    def landings_world_m(self) -> list[Array]:
        """Centres of the tips, (3,) each, at each landing on the object in the last approach."""
        return self._arrival.landings_world_m

    def _begin(self, plan: GraspPlan) -> None:
        """Another grasp: nothing was landed on in its approach."""
        self._plan, self._arrival.landings_world_m = plan, []

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
        self._begin(plan)
        if plan.only_touch:
            return self._touch(plan)
        if self._table().is_sideways:
            return self._come_from_the_side()
        landed: set[str] = set()
        if plan.tap:
            self._toucher.tap(plan.frame)
        for _ in range(self.settings.landing_tries):
            self._move_above()
            hit = self._arrival.come_down(self._place)
            if not hit:
                self._motion.supervisor.on_approach()
                return True
            up_m = self._arrival.short_of_m(self._place)
            self._arrival.come_up(self._place)
            self.lift()
            if (again := self._otherwise(plan, hit, landed, up_m)) is None:
                return False
            self._plan = again
        return False

    def _otherwise(self, plan: GraspPlan, hit: tuple[str, ...], landed: set[str], up_m: float) -> GraspPlan | None:
        """The plan after a landing ``up_m`` above the grasp: where only links did, which would land again a little
        aside, so much higher; otherwise as :func:`evade` says. None where that may not be.
        """
        if not (fingers := [finger for finger in hit if finger in self._hand.form.fingers]):
            top_m = self._motion.tallest_m
            return self.plan.raised(up_m, np.inf if top_m is None else top_m - _BELOW_TOP_m)
        if not plan.may_shift:
            return None
        landed.update(fingers)
        shift_m = self.settings.landing_shift_m
        return evade(plan, self.plan, fingers, landed, self._table(), shift_m, self._yaw_window_rad)

    def _touch(self, plan: GraspPlan) -> bool:
        """Only touch, and rise again."""
        if plan.down_to_m is not None:
            self._toucher.touch_top(plan.frame, plan.down_to_m)
            return True
        if plan.opening is not None:
            self._toucher.touch_inside(plan.frame, plan.opening)
            return True
        if not self._table().is_sideways:
            self._toucher.tap(plan.frame, self.settings.touch.below_top_m)
            return True
        felt = self._touch_side(plan)
        if felt is None:
            self._arrival.note(self._place, self._toucher.guard)
        return felt is not None

    def _touch_side(self, plan: GraspPlan) -> SideTouch | None:
        """Touch the side that a grasp from the side comes from."""
        side = next(side for side in SIDES if plan.closing.endswith(side))
        beyond_m = self.settings.touch.past_side_m if plan.only_touch else 0.0
        places = plan.places or (TouchPlace(plan.frame, plan.height_m),)
        return self._toucher.touch_side(places, side, self.settings.standoff_m, beyond_m)

    def _move_above(self) -> None:
        s = self.settings
        self._motion.climb(self._above(), s.travel_m_s)
        self.fingers.open_for(self._table())
        self._motion.move_base(self._motion.unwound(self._above()), s.travel_m_s, s.turn_rad_s)
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
        if self.plan.tap:
            self._touch_side(self.plan)
        self._move_above()
        if not self._arrival.come_beside(self._place, self._away_m):
            self._motion.climb(self._above(), self.settings.travel_m_s)
            return False
        if not self._arrival.come_in(self._place):
            self._toucher.capture()
            self.lift()
            return False
        self._motion.supervisor.on_approach()
        return True

    # --- close and measure -------------------------------------------------------------------------------------

    def close(self) -> None:
        """Close the fingers that shall until they touch; see :meth:`GraspFingers.close`."""
        self.fingers.close(self.plan.stays_open)

    def settle(self) -> None:
        """Bring the fingers that touch to the contact force, then let hand and object come to rest."""
        self.fingers.settle(self.contact_N)

    @property
    def contact_N(self) -> float:
        """Force that each touching finger settles to."""
        return self.settings.gentle_force_N if self.plan.is_gentle else self.settings.contact_force_N

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

    def weigh(self, touching: frozenset[str]) -> Lift:
        """Drag, lift and set down the object that these fingers hold; the runtime's perception knows what was found."""
        unit_N = max(self.fingers.balanced_forces_N(touching, 1.0).values())

        def hold(force_N: float, only_felt: bool) -> None:
            forces_N, felt = self.fingers.balanced_forces_N(touching, force_N), self.fingers.pressed(_LEAST_HOLD_N)
            self.fingers.servo_forces({f: each_N for f, each_N in forces_N.items() if f in felt or not only_felt})

        grip = Grip(
            hold=hold,
            share_pressed=lambda share: share * self.settings.pressed_N / unit_N,
            holding=lambda: frozenset(self.fingers.pressed(_LEAST_HOLD_N)),
            is_pressed=lambda: bool(self.fingers.pressed(self.settings.pressed_N)),
        )
        lift = Weigher(self._motion, self.settings.weighing, grip).weigh(self.plan.frame, self._table())
        if lift.end is LiftEnd.ABOVE:
            self.fingers.rise()
        if lift.end.is_held:
            self.fingers.ease(touching, self.settings.weighing.squeeze_N)
        self._motion.runtime.end_hold()
        return lift

    # --- and away ----------------------------------------------------------------------------------------------

    def release(self) -> None:
        """Open the hand; see :meth:`GraspFingers.release`."""
        self.fingers.release()

    def lift(self) -> None:
        """Back along the approach, where the hand came from the side, then straight up.

        From beside the object the open fingers may be under what is wider above: they pass it slowly.
        """
        s, motion = self.settings, self._motion
        if self._away_m:
            motion.move_base(motion.base_joints(self.plan.frame, self._table(), 0.0, self._away_m), s.travel_m_s, 1.0)
        else:
            motion.climb(self._above(), _BESIDE_m_s, _BESIDE_m)
        motion.move_base(self._above(), s.travel_m_s, s.turn_rad_s)

    def idle(self) -> None:
        """One cycle without motion."""
        self._motion.tick()

    @property
    def _place(self) -> Place:
        return Place.of(self.plan, self._hand)

    def _table(self) -> Closing:
        return closing(self.plan.closing, self.plan.height_m, self._hand)
