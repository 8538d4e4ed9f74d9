"""A world of discs that keeps a trace of everything the hand is told and feels, and its summary for a baseline."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from drivers.core.contacts import FINGERS
from drivers.shadow.closing.posture import HandShape
from drivers.shadow.model.kinematics import JOINTS
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_cycle import GraspCycle
from sessions.motion.motion import Motion
from sessions.motion.safety import SafetySettings, SafetySupervisor
from sessions.recording.session_events import EventKind
from sessions.rig_runtime.flight_recorder import CycleSnapshot
from tests.support.disc_world import Disc, DiscWorld, TIP_CENTRE_m

TIP = HandShape((0.0085, 0.0085, 0.0085), tuple(TIP_CENTRE_m))
_FRICTION_counts_s_m = 1e4
_MIXTURES = np.cos(np.outer(np.arange(len(JOINTS)), np.arange(1, 4)))
"""Fixed mixtures of the joints: three numbers change if any joint does."""


class TracedWorld(DiscWorld):
    """Keeps each cycle's joints, positioner and loads, divided by the session events.

    Args:
        disc, before_cycle: as of a world of discs.
    """

    def __init__(self, disc: Disc | None, before_cycle: Callable[[DiscWorld], None] | None = None) -> None:
        self.parts: list[tuple[str, list[np.ndarray]]] = [("begin", [])]
        super().__init__(disc, before_cycle)

    def cycle(self) -> None:
        super().cycle()
        loads_N = list(self.perception.loads_N().values())
        self.parts[-1][1].append(np.concatenate([self.base_q, self.joints_rad @ _MIXTURES, loads_N]))

    def snapshot(self) -> CycleSnapshot:
        """With strain gauges that show how fast the positioner moves, as friction does."""
        rows = self.parts[-1][1][-2:]
        way_m = float(np.linalg.norm(rows[-1][:3] - rows[0][:3])) if rows else 0.0
        return replace(
            super().snapshot(), motor_torques=np.full(20, _FRICTION_counts_s_m * way_m / self.cycle_ns * 1e9)
        )

    def _mark(self, kind: EventKind, fingers: tuple[str, ...] = FINGERS) -> object:
        self.part(f"{kind}" if fingers == FINGERS else f"{kind} {'-'.join(fingers)}")
        return super()._mark(kind, fingers)

    def part(self, name: str) -> None:
        """A new part of the trace begins."""
        self.parts.append((name, []))

    def begin_dragging(self) -> None:
        self._mark(EventKind.DRAG_BEGIN)

    def end_dragging(self) -> None:
        self._mark(EventKind.DRAG_END)

    def begin_hanging(self) -> None:
        self._mark(EventKind.HANG_BEGIN)

    def end_hanging(self) -> None:
        self._mark(EventKind.HANG_END)

    def summary(self) -> list[Any]:
        """For each part its name, its number of cycles, and mean, end and greatest of what was told and felt."""
        return [[name, len(rows), *_numbers(np.array(rows))] for name, rows in self.parts if rows or name != "begin"]


def _numbers(rows: np.ndarray) -> list[Any]:
    return [] if not len(rows) else [rows.mean(axis=0), rows[-1], rows[:, -len(FINGERS) :].max(axis=0)]


def grasp_cycle(
    world: DiscWorld, settings: CycleSettings | None = None, window_rad: tuple[float, float] = (-1.31, 1.31)
) -> tuple[GraspCycle, Motion]:
    """Its cycle and motion in a world, as a session makes them."""
    motion = Motion(world, SafetySupervisor(world, SafetySettings(), world.cycle_ns))  # type: ignore[arg-type]
    return GraspCycle(motion, settings or CycleSettings(), TIP, window_rad), motion
