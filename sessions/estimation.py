"""The estimation beside a running session: a step for each grasp, recorded, without starving the devices."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from sessions.bench import Bench
from sessions.decisions import DecisionMaker
from sessions.slam_memory import SlamMemory
from sessions.view_messages import surface_message
from tactile_lab.clock import VirtualClock
from tactile_lab.geometry.contacts import Grasp
from tactile_lab.slam import TactileSlam
from tactile_lab.slam_result import SlamStep

Answer = TypeVar("Answer")


class Estimation:
    """Takes grasps one after the other, tells whoever decides, and records each step.

    Args:
        bench: of the session.
        slam: fresh.
        decisions: is told about each step.
        idle: runs one cycle of the devices.
    """

    def __init__(self, bench: Bench, slam: TactileSlam, decisions: DecisionMaker, idle: Callable[[], None]) -> None:
        self._bench, self._slam, self._decisions, self._idle = bench, slam, decisions, idle
        self._memory = SlamMemory(slam)

    def step(self, grasp: Grasp) -> SlamStep:
        """One step of the estimation."""
        self._memory.remember()
        step = self.think(lambda: self._slam.take(grasp))
        self.think(lambda: self._decisions.estimated(step))
        state = {"index": step.index, "verdict": step.verdict, "reason": step.reason, "seconds": step.seconds}
        self._bench.recorder.slam(self._bench.clock.now_ns(), step.world_T_object, state, step.covariance)
        surface = self.think(lambda: surface_message(self._decisions.known_shape()))
        self._bench.recorder.surface(self._bench.clock.now_ns(), surface)
        return step

    def undo(self) -> None:
        """Back to before the last step."""
        self._memory.undo()

    def think(self, question: Callable[[], Answer]) -> Answer:
        """Compute without starving the devices: simulated time waits, real time is spent in cycles."""
        if isinstance(self._bench.clock, VirtualClock):
            return question()
        with ThreadPoolExecutor(1) as worker:
            answer = worker.submit(question)
            while not answer.done():
                self._idle()
            return answer.result()
