"""A grasp led by keys: for a hand that cannot be moved by hand, and for the simulated hand.

The hand moves only on request: by one increment, or a whole stage of the grasp automatically. Every motion stops if a
fingertip touches something.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array, Grasp
from drivers.shadow.closing.posture import HandShape
from sessions.guided.console import OperatorConsole
from sessions.guided.motion import GuidedMotion
from sessions.guided.operator import Ask, Request, Stage
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_cycle import GraspCycle
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.travel import travel_height_m
from sessions.recording.recorder import Level

AROUND_m = 0.001
"""The hand counts as around the object up to this height above its grasp height."""


class GraspByKeys(GraspCycle):
    """The steps of a grasp, each executed on request.

    Args:
        motion: supervised motion that reads the operator's requests.
        settings: speeds, forces, times.
        console: the operator's console.
        hand: its form, and the shape of its fingertips.
        yaw_window_rad: yaws the arm can reach.
    """

    def __init__(
        self,
        motion: GuidedMotion,
        settings: CycleSettings,
        console: OperatorConsole,
        hand: HandShape,
        yaw_window_rad: tuple[float, float],
    ) -> None:
        super().__init__(motion, settings, hand, yaw_window_rad)
        self._guided, self._console = motion, console
        self._above_m: float | None = None
        """Height above the grasp height; None if the hand has not been sent to this grasp."""

    # --- down --------------------------------------------------------------------------------------------------

    def descend(self, plan: GraspPlan) -> bool:
        self._free_the_hand()
        self._begin(plan)
        self._above_m = None
        if self._table().is_sideways:
            prompt = "The hand comes from the object's side. g: go as suggested"
            self._console.enter(Stage.GUIDE, prompt, Ask.GO, Ask.GIVE_UP)
        else:
            prompt = "Move the hand around the object. g: go as suggested; arrows, r, f, comma, full stop: steps"
            self._console.enter(Stage.GUIDE, prompt, Ask.GO, Ask.MOVE, Ask.NEXT, Ask.GIVE_UP)
        for request in self._guided.requests():
            if request.ask is Ask.GO:
                arrived = super().descend(self.plan)
                self._above_m = 0.0 if arrived else self._travel_m()
                return arrived
            if self._table().is_sideways:
                self._console.tell("a grasp from the side is not led by steps. g: go as suggested")
            elif request.ask is Ask.MOVE:
                self._move_step(request)
            elif request.ask in (Ask.NEXT, Ask.CAPTURE) and self._is_around():
                self._motion.supervisor.on_approach()
                return True
        return False

    def _is_around(self) -> bool:
        if self._above_m is not None and self._above_m <= AROUND_m:
            return True
        height = "not over the object yet" if self._above_m is None else f"{1e3 * self._above_m:.0f} mm too high"
        self._console.tell(f"the hand is {height}. f: lower it; g: go as suggested")
        return False

    def _move_step(self, request: Request) -> None:
        """Move the hand by one step; the first one moves it above the suggested grasp."""
        if self._above_m is None:
            self._move_above()
            self._above_m = self._travel_m()
            return
        jog = self._console.settings
        frame = self.plan.frame.move(jog.jog_m * request.x, jog.jog_m * request.y, jog.jog_rad * request.turn)
        above_m = max(0.0, self._above_m + jog.jog_m * request.z)
        start = self._motion.base_joints(self.plan.frame, self._table(), self._above_m)
        if self._go_with_care(start, self._motion.base_joints(frame, self._table(), above_m)):
            self._plan, self._above_m = replace(self.plan, frame=frame), above_m
            self._console.tell(f"tips {1e3 * above_m:.0f} mm above their grasp height")

    def _travel_m(self) -> float:
        """How far above the grasp the hand travels."""
        return travel_height_m(self._table(), self._motion, self.settings, self._hand)

    def _go_with_care(self, start: Array, end: Array) -> bool:
        """Move straight to ``end``; back to ``start`` if a fingertip touches something."""
        jog = self._console.settings
        way_m, turn_rad = float(np.linalg.norm((end - start)[:3])), float(np.abs((end - start)[3:]).max())
        for share in self._motion.shares(max(way_m / jog.jog_m_s, turn_rad / jog.jog_rad_s)):
            self._motion.set_base(start + share * (end - start))
            self._motion.tick()
            if met := self.fingers.pressed(self.settings.landing_force_N):
                self._motion.set_base(start)
                self._motion.wait(self.settings.rest_s)
                self._console.tell(f"{', '.join(met)} touched something: moved back by one step", Level.WARNING)
                return False
        return True

    def _free_the_hand(self) -> None:
        """After a failure the hand may still be around the object: open and lift it first."""
        self._guided.begin_anew()
        if self._above_m is not None:
            super().release()
            self.lift()

    # --- close and measure -------------------------------------------------------------------------------------

    def close(self) -> None:
        prompt = "Close the fingers. g: close automatically; 1-5 close, 6-0 open one finger; c, o all; SPACE: done"
        self._console.enter(Stage.CLOSE, prompt, Ask.GO, Ask.FINGERS, Ask.NEXT, Ask.GIVE_UP)
        self.fingers.set_open()
        begun = False
        for request in self._guided.requests():
            if request.ask is Ask.GO:
                super().close()
                return
            if request.ask is Ask.FINGERS:
                if not begun:
                    self._motion.runtime.begin_closing()
                    begun = True
                self._step_fingers(request)
            elif request.ask in (Ask.NEXT, Ask.CAPTURE):
                self.fingers.touching = frozenset(self.fingers.pressed(self.settings.touch_force_N))
                return

    def _step_fingers(self, request: Request) -> None:
        """Close or open fingers by steps along their paths; each stops when it touches."""
        table, progress = self.fingers.table, self.fingers.progress
        way_m = self._console.settings.finger_step_m * request.steps
        asked = [finger for finger in request.fingers if finger in self._hand.form.fingers]
        moving = set(asked)
        cycles = self._motion.cycles(abs(way_m) / (self.settings.closing_m_s * self._motion.supervisor.speed_scale))
        for _ in range(cycles):
            if way_m > 0.0:
                moving -= set(self.fingers.pressed(self.settings.touch_force_N))
                moving = {finger for finger in moving if self.fingers.may_close(finger, way_m / cycles)}
            for finger in moving:
                step = way_m / cycles / table.path(finger).length_m
                progress[finger] = float(np.clip(progress[finger] + step, *table.path(finger).valid))
            self._motion.set_fingers(table, progress)
            self._motion.tick()
        stopped = [finger for finger in asked if finger not in moving]
        if stopped and way_m > 0.0:
            self._console.tell(f"{', '.join(stopped)} stopped")

    def settle(self) -> None:
        self._console.enter(Stage.HOLD, "Bringing the fingers to the contact force", Ask.GIVE_UP)
        super().settle()
        self._console.enter(Stage.HOLD, "Hold still. SPACE: capture; x: give up", Ask.CAPTURE, Ask.GIVE_UP)
        hold_N = self.fingers.balanced_forces_N(self.fingers.touching, self.contact_N)
        while not self._console.wants_capture():
            self.fingers.servo_forces(hold_N)
            self._motion.tick()

    def capture(self) -> Grasp:
        self._console.enter(Stage.CAPTURE, "Capturing: hold still")
        return super().capture()

    # --- carry and away ----------------------------------------------------------------------------------------

    def squeeze(self, touching: frozenset[str]) -> None:
        self._console.enter(Stage.ROTATE, "Building up the squeeze")
        super().squeeze(touching)

    def reorient(self, turn_rad: float, shift_world_m: Array, touching: frozenset[str]) -> Pose3:
        wanted = f"{np.degrees(turn_rad):+.0f}°"
        prompt = f"Turn the object. g: {wanted} as suggested; comma, full stop, arrows: steps; SPACE: done"
        self._console.enter(Stage.ROTATE, prompt, Ask.GO, Ask.MOVE, Ask.NEXT, Ask.UNDO)
        hold_N = self.fingers.balanced_forces_N(touching, self.holding_N)
        motion, jog = Pose3(), self._console.settings
        for request in self._guided.requests(lambda: self.fingers.servo_forces(hold_N)):
            if request.ask is Ask.GO:
                return super().reorient(turn_rad, shift_world_m, touching) * motion
            if request.ask is Ask.MOVE:
                shift_m = jog.jog_m * np.array([request.x, request.y], dtype=float)
                motion = super().reorient(jog.jog_rad * request.turn, shift_m, touching) * motion
            elif request.ask in (Ask.NEXT, Ask.CAPTURE):
                break
        return motion

    def release(self) -> None:
        self._console.enter(Stage.RELEASE, "Releasing the object")
        if self._above_m is not None:
            super().release()

    def lift(self) -> None:
        if self._above_m is not None:
            super().lift()
            self._above_m = None

    def idle(self) -> None:
        if self._console.paused:
            self._guided.rest()
        else:
            super().idle()
