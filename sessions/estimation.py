"""The estimation beside a running session: a step for each grasp, recorded."""

from __future__ import annotations

from gtsam import Pose3

from sessions.bench import Bench
from sessions.thinker import Estimate, Thinker
from sessions.thinking import Thinking
from tactile_lab.geometry.contacts import Grasp


class Estimation:
    """Has grasps estimated one after the other, and records each step.

    Args:
        bench: of the session.
        thinking: where it is estimated.
    """

    def __init__(self, bench: Bench, thinking: Thinking) -> None:
        self._bench, self._thinking = bench, thinking
        self._known = 0
        """Estimates that are recorded and have not been taken back."""

    def step(self, grasp: Grasp) -> Estimate:
        """One step of the estimation."""
        estimates = self._thinking.ask(Thinker.estimate, grasp, self._known)
        for estimate in estimates:
            self._record(estimate)
        self._known += len(estimates)
        return estimates[-1]

    def undo(self, hand_motion_world: Pose3) -> None:
        """Back to before the last step; the hand carried the object so far since the grasp before it."""
        self._thinking.ask(Thinker.undo, hand_motion_world)
        self._known -= 1

    def _record(self, estimate: Estimate) -> None:
        recorder, now_ns, step = self._bench.recorder, self._bench.clock.now_ns(), estimate.step
        state = {"index": step.index, "verdict": step.verdict, "reason": step.reason, "seconds": step.seconds}
        recorder.slam(now_ns, step.world_T_object, state, step.covariance)
        recorder.surface(now_ns, estimate.surface)
