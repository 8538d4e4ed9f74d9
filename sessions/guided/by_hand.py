"""A grasp led by hand: a person moves arm and fingers, the program only measures (thesis section 3.6)."""

from __future__ import annotations

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array, Grasp
from drivers.shadow.closing.closing import closing
from drivers.shadow.closing.posture import HandShape
from sessions.guided.console import OperatorConsole
from sessions.guided.motion import GuidedMotion
from sessions.guided.operator import Ask, Stage
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from sessions.perception.carrying.slip import Slip
from sessions.recording.recorder import Level


class GraspByHand:
    """The steps of a grasp as prompts; the hand has no demands, the positioner stays or is moved by hand.

    A positioner that can be led is let go while the person guides, turns or opens, and holds still in between.

    Args:
        motion: supervised cycles that read the operator's requests; nothing is moved.
        settings: the length of a capture.
        console: the operator's console.
        hand: its form, and the shape of its fingertips.
    """

    def __init__(
        self, motion: GuidedMotion, settings: CycleSettings, console: OperatorConsole, hand: HandShape
    ) -> None:
        self._motion, self.settings, self._console, self._hand = motion, settings, console, hand
        self._plan: GraspPlan | None = None
        self.landings_world_m: list[Array] = []
        self.jammed: tuple[str, ...] = ()
        self.slipped: Slip | None = None

    @property
    def plan(self) -> GraspPlan:
        """The grasp as the person does it: its frame follows from the palm's pose."""
        assert self._plan is not None
        table = closing(self._plan.closing, self._plan.height_m, self._hand)
        world_T_grasp = self._motion.runtime.perception.hand.world_T_palm * table.grasp_T_palm.inverse()
        frame = GraspFrame(float(world_T_grasp.x()), float(world_T_grasp.y()), float(world_T_grasp.rotation().yaw()))
        return GraspPlan(frame, self._plan.closing, self._plan.height_m, "led by hand")

    def descend(self, plan: GraspPlan) -> bool:
        self._plan = plan
        self._motion.runtime.lead_by_hand()
        prompt = "Guide the open hand around the object without touching it. SPACE: zero the fingertips"
        self._console.enter(Stage.GUIDE, prompt, Ask.NEXT, Ask.GIVE_UP)
        for request in self._motion.requests():
            if request.ask in (Ask.NEXT, Ask.GO) and self._zero():
                self._motion.runtime.stop()
                self._motion.supervisor.on_approach()
                return True
        self._motion.runtime.stop()
        return False

    def _zero(self) -> bool:
        refused = self._motion.runtime.tare().refused
        for finger, reason in refused.items():
            self._console.tell(f"{finger}: {reason}", Level.WARNING)
        return not refused

    def close(self) -> None:
        prompt = "Close the fingers around the object by hand. SPACE: fingers touch"
        self._console.enter(Stage.CLOSE, prompt, Ask.NEXT, Ask.GIVE_UP)
        self._motion.runtime.begin_closing()
        for request in self._motion.requests():
            if request.ask in (Ask.NEXT, Ask.GO, Ask.CAPTURE):
                return

    def settle(self) -> None:
        self._console.enter(Stage.HOLD, "Hold still. SPACE: capture; x: give up", Ask.CAPTURE, Ask.GIVE_UP)
        while not self._console.wants_capture():
            self._motion.tick()

    def capture(self) -> Grasp:
        self._console.enter(Stage.CAPTURE, "Capturing: hold still")
        return self._motion.capture(self.settings.capture_s)

    def squeeze(self, touching: frozenset[str]) -> None:
        """The person squeezes."""

    def reorient(self, turn_rad: float, shift_world_m: Array, touching: frozenset[str]) -> Pose3:
        prompt = f"Squeeze, turn the object by about {np.degrees(turn_rad):+.0f}° and put it down. SPACE: done"
        self._console.enter(Stage.ROTATE, prompt, Ask.NEXT, Ask.UNDO)
        runtime = self._motion.runtime
        world_T_before = runtime.perception.hand.world_T_palm
        runtime.begin_hold()
        runtime.lead_by_hand()
        for request in self._motion.requests():
            if request.ask in (Ask.NEXT, Ask.GO):
                break
        runtime.stop()
        runtime.end_hold()
        return runtime.perception.hand.world_T_palm * world_T_before.inverse()

    def release(self) -> None:
        self._console.enter(
            Stage.RELEASE, "Open the hand and move it away. SPACE: no finger touches any more", Ask.NEXT
        )
        self._motion.runtime.lead_by_hand()
        for request in self._motion.requests():
            if request.ask in (Ask.NEXT, Ask.GO):
                self._motion.runtime.stop()
                return

    def lift(self) -> None:
        """The person lifts."""

    def idle(self) -> None:
        if self._console.paused:
            self._motion.rest()
        else:
            self._motion.tick()
