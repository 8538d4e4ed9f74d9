"""Touches without a grasp: a tap on the top, a probe from the side.

The hand takes up a posture of one of the closings, fingers partly closed, and the positioner carries it in a straight
line until something is met; the fingertips then lie against the object, as many as meet it. The contacts wait for
the next grasp (:attr:`~sessions.marks.MarkKind.TOUCH_END`): it finds the object where the touch left it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from drivers.shadow.closing import Closing, closing
from drivers.shadow.posture import TipEllipsoid
from drivers.shadow.tip_motion import motor_rates
from sessions.cycle_settings import CycleSettings, TouchSettings
from sessions.motion import GraspFrame, Motion
from tactile_lab.geometry.contacts import Array


@dataclass(frozen=True)
class Pattern:
    """How the fingertips stand to each other in a touch.

    Attributes:
        closing: whose lines they are on.
        progress: how far along them, by finger.
    """

    closing: str
    progress: Mapping[str, float]


TAP = Pattern("radial", {"FF": 0.70, "MF": 0.86, "RF": 0.78, "LF": 0.68, "TH": 0.62})
"""Five fingertips around the middle of the grasp frame, far enough apart not to touch each other."""

_TARES = 3
"""A fingertip that still swings is given so many rests."""

TAP_HEIGHT_m = 0.022
"""Of the closing's table; the positioner does the rest of the height."""


class Toucher:
    """Touches the object.

    Args:
        motion: supervised motion.
        cycle: speeds, forces and times.
        tip: shape of the fingertips.
    """

    def __init__(self, motion: Motion, cycle: CycleSettings, tip: TipEllipsoid) -> None:
        self._motion, self._cycle, self._tip = motion, cycle, tip
        self._resting_N: dict[str, float] = {}

    @property
    def settings(self) -> TouchSettings:
        """Speeds and forces of touching."""
        return self._cycle.touch

    def tap(self, frame: GraspFrame) -> bool:
        """Come down on what stands under a grasp frame, lay the fingertips on it, and rise again.

        Returns:
            Whether anything was met.
        """
        s, table, motion = self.settings, closing(TAP.closing, TAP_HEIGHT_m, self._tip), self._motion
        self._poise(table, TAP, frame)
        lowest_m = s.lowest_m + self._tip.semi_axes_m[2] - TAP_HEIGHT_m
        motion.bench.begin_closing()
        met = self._approach(motion.base_joints(frame, table, lowest_m), s.tap_m_s)
        if met:
            self._lay_on(table, TAP, np.array([0.0, 0.0, -1.0]), frame)
        self._capture()
        motion.move_base(motion.base_joints(frame, table, self._cycle.lift_m), *self._travel)
        return met

    @property
    def _travel(self) -> tuple[float, float]:
        return self._cycle.travel_m_s, self._cycle.turn_rad_s

    def _poise(self, table: Closing, pattern: Pattern, frame: GraspFrame) -> None:
        """The hand above a grasp frame, fingers as they should touch, its sensors tared."""
        motion, cycle = self._motion, self._cycle
        motion.blend_fingers(table, pattern.progress, cycle.finger_rad_s)
        motion.move_base(motion.base_joints(frame, table, cycle.lift_m), *self._travel)
        for _ in range(_TARES):
            motion.wait(cycle.rest_s)
            refused = motion.bench.tare().refused
            self._resting_N = {finger: motion.loads_N()[finger] for finger in refused}
            if not refused:
                return

    def _approach(self, goal: Array, speed_m_s: float) -> bool:
        """Toward ``goal`` until a fingertip meets something; the positioner then stands where it is."""
        motion = self._motion
        for q in motion.line(goal, speed_m_s):
            motion.set_base(q)
            motion.tick()
            if max(self._felt_N().values(), default=0.0) > self.settings.met_N:
                motion.set_base(motion.bench.perception.base_q)
                return True
        return False

    def _lay_on(self, table: Closing, pattern: Pattern, direction_grasp: Array, frame: GraspFrame) -> None:
        """Every fingertip moves along a direction until it touches as it should, or has gone as far as it may.

        The hand sinks a little meanwhile, and the fingers that touch give way: the thumb hardly moves that way itself.
        """
        s, motion = self.settings, self._motion
        rates = motor_rates(table, pattern.progress, direction_grasp, self._tip)
        gone_m = dict.fromkeys(rates, 0.0)
        for q in self._sinking(direction_grasp, frame):
            if max(self._felt_N().values(), default=0.0) < s.most_N:
                motion.set_base(q)
            for finger, load_N in self._felt_N().items():
                step_m = s.gain * float(np.clip(s.force_N - load_N, -1.0, 1.0)) * motion.cycle_s
                gone_m[finger] = float(np.clip(gone_m[finger] + step_m, -s.reach_m, s.reach_m))
            aside = {motor: rate * gone_m[f] for f, motors in rates.items() for motor, rate in motors.items()}
            motion.set_fingers(table, pattern.progress, aside)
            motion.tick()

    def _sinking(self, direction_grasp: Array, frame: GraspFrame) -> Iterator[Array]:
        """Positioner targets while the fingertips are laid on, one a cycle."""
        motion, start = self._motion, self._motion.bench.perception.base_q.copy()
        way = np.zeros(6)
        way[:3] = self._motion.bench.world_T_mount.rotation().unrotate(frame.pose.rotation().rotate(direction_grasp))
        for share in motion.shares(self.settings.press_s):
            yield start + min(1.0, 2.0 * share) * self.settings.sink_m * way

    def _felt_N(self) -> dict[str, float]:
        """Contact forces of the fingertips; of those that could not be tared, what they feel more than at rest."""
        return {f: load_N - self._resting_N.get(f, 0.0) for f, load_N in self._motion.loads_N().items()}

    def _capture(self) -> None:
        motion = self._motion
        motion.bench.begin_capture()
        motion.wait(self.settings.capture_s)
        motion.bench.end_touch()
