"""A grasp led by hand: a person moves arm and fingers, the program watches and measures (thesis section 3.6)."""

from __future__ import annotations

import numpy as np
from gtsam import Pose3

from drivers.shadow.closing import closing
from drivers.shadow.posture import TipEllipsoid
from sessions.cycle_settings import CycleSettings
from sessions.grasp_plan import GraspPlan
from sessions.guided.desk import Desk
from sessions.guided.motion import GuidedMotion
from sessions.guided.operator import Ask, Stage
from sessions.motion import GraspFrame
from sessions.recorder import Level
from tactile_lab.geometry.contacts import Array, Grasp


class GraspByHand:
    """The verbs of a grasp as prompts; the hand is without demand, the positioner stays or is moved by hand.

    Args:
        motion: supervised cycles that listen to the person; nothing is moved.
        settings: the length of a capture.
        desk: where the person sits.
        tip: shape of the fingertips.
    """

    def __init__(self, motion: GuidedMotion, settings: CycleSettings, desk: Desk, tip: TipEllipsoid) -> None:
        self._motion, self.settings, self._desk, self._tip = motion, settings, desk, tip
        self._plan: GraspPlan | None = None
        self.landings_world_m: list[Array] = []
        self.jammed: tuple[str, ...] = ()

    @property
    def plan(self) -> GraspPlan:
        """The grasp as the person does it: the frame is where the palm's pose puts it."""
        assert self._plan is not None
        table = closing(self._plan.closing, self._plan.height_m, self._tip)
        world_T_grasp = self._motion.bench.perception.world_T_palm * table.grasp_T_palm.inverse()
        frame = GraspFrame(float(world_T_grasp.x()), float(world_T_grasp.y()), float(world_T_grasp.rotation().yaw()))
        return GraspPlan(frame, self._plan.closing, self._plan.height_m, "led by hand")

    def descend(self, plan: GraspPlan) -> bool:
        self._plan = plan
        self._motion.bench.stop()
        prompt = "Guide the open hand around the object, touching nothing; SPACE: zero the fingertips there"
        self._desk.enter(Stage.GUIDE, prompt, Ask.NEXT, Ask.GIVE_UP)
        for request in self._motion.requests():
            if request.ask in (Ask.NEXT, Ask.GO) and self._zero():
                self._motion.supervisor.approached()
                return True
        return False

    def _zero(self) -> bool:
        refused = self._motion.bench.tare().refused
        for finger, reason in refused.items():
            self._desk.tell(f"{finger}: {reason}", Level.WARNING)
        return not refused

    def close(self) -> None:
        prompt = "Close the fingers around the object by hand; SPACE: they touch"
        self._desk.enter(Stage.CLOSE, prompt, Ask.NEXT, Ask.GIVE_UP)
        self._motion.bench.begin_closing()
        for request in self._motion.requests():
            if request.ask in (Ask.NEXT, Ask.GO, Ask.CAPTURE):
                return

    def settle(self) -> None:
        self._desk.enter(Stage.HOLD, "Hold still; SPACE: capture; x: give up", Ask.CAPTURE, Ask.GIVE_UP)
        while not self._desk.wants_capture():
            self._motion.tick()

    def capture(self) -> Grasp:
        self._desk.enter(Stage.CAPTURE, "Capturing: hold still")
        return self._motion.capture(self.settings.capture_s)

    def squeeze(self, touching: frozenset[str]) -> None:
        """The person squeezes."""

    def reorient(self, turn_rad: float, shift_world_m: Array, touching: frozenset[str]) -> Pose3:
        prompt = f"Squeeze, turn the object about {np.degrees(turn_rad):+.0f}° and put it down; SPACE: it rests"
        self._desk.enter(Stage.ROTATE, prompt, Ask.NEXT, Ask.UNDO)
        bench = self._motion.bench
        world_T_before = bench.perception.world_T_palm
        bench.begin_hold()
        for request in self._motion.requests():
            if request.ask in (Ask.NEXT, Ask.GO):
                break
        bench.end_hold()
        return bench.perception.world_T_palm * world_T_before.inverse()

    def release(self) -> None:
        self._desk.enter(Stage.RELEASE, "Open the hand and take it away; SPACE: nothing touches any more", Ask.NEXT)
        for request in self._motion.requests():
            if request.ask in (Ask.NEXT, Ask.GO):
                return

    def lift(self) -> None:
        """The person lifts."""

    def idle(self) -> None:
        if self._desk.paused:
            self._motion.rest()
        else:
            self._motion.tick()
