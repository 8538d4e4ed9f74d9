"""Estimation during a session: one recorded step per grasp."""

from __future__ import annotations

from gtsam import Pose3

from drivers.core.contacts import Grasp
from sessions.conductor.estimator import Estimate, EstimatorService
from sessions.conductor.estimator_client import EstimatorClient
from sessions.rig_runtime.rig_runtime import RigRuntime


class Estimation:
    """Estimates grasps one after the other, and records each step.

    Args:
        runtime: of the session.
        estimator: client of the estimator.
    """

    def __init__(self, runtime: RigRuntime, estimator: EstimatorClient) -> None:
        self._runtime, self._estimator = runtime, estimator
        self._known = 0
        """Recorded estimates that have not been undone."""

    def step(self, grasp: Grasp) -> Estimate:
        """One step of the estimation."""
        estimates = self._estimator.ask(EstimatorService.estimate, grasp, self._known)
        for estimate in estimates:
            self._record(estimate)
        self._known += len(estimates)
        return estimates[-1]

    def undo(self, hand_motion_world: Pose3) -> None:
        """Undo the last step. ``carried`` is how the hand carried the object since the grasp before it."""
        self._estimator.ask(EstimatorService.undo, hand_motion_world)
        self._known -= 1

    def _record(self, estimate: Estimate) -> None:
        recorder, now_ns, step = self._runtime.recorder, self._runtime.clock.now_ns(), estimate.step
        state = {"index": step.index, "verdict": step.verdict, "reason": step.reason, "seconds": step.seconds}
        recorder.slam(now_ns, step.world_T_object, {**state, **estimate.trust}, step.covariance)
        recorder.surface(now_ns, estimate.surface)
