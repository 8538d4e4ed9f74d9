"""An autonomous session with an operator on the page, who may pause it, undo a grasp or end it between grasps."""

from __future__ import annotations

from collections.abc import Callable

from sessions.conductor.decisions import Decision, End, Pause, UndoGrasp
from sessions.conductor.estimator import PolicyChoice
from sessions.conductor.estimator_client import EstimatorClient
from sessions.conductor.policy_decisions import Approve, PolicyDecisions
from sessions.guided.operator import Ask, Operator
from sessions.motion.safety import InterruptGuard


class AttendedDecisions(PolicyDecisions):
    """The planner's decisions, recorded and approved as usual, unless the operator requests something else.

    Args:
        estimator: client of a planner with or without a policy.
        tell: receives every decision of the policy that no request overrides.
        approve: asked before every grasp.
        operator: the person; requests are read between grasps.
        guard: receives Ctrl+C.
        wait: called in every cycle of a pause; makes a simulated rig wait for the person.
    """

    def __init__(
        self,
        estimator: EstimatorClient,
        tell: Callable[[PolicyChoice], None],
        approve: Approve,
        operator: Operator,
        guard: InterruptGuard | None = None,
        wait: Callable[[], None] = lambda: None,
    ) -> None:
        super().__init__(estimator, tell, approve, guard)
        self._operator, self._wait = operator, wait
        self._paused = False

    def decide(self, index: int) -> Decision:
        for request in self._operator.requests():
            if request.ask is Ask.PAUSE:
                self._paused = not self._paused
            elif request.ask is Ask.UNDO:
                return UndoGrasp("by the operator on the page")
            elif request.ask is Ask.END:
                return End(f"ended by the operator on the page after {index} grasps")
        if not self._paused:
            return super().decide(index)
        self._wait()
        return Pause("by the operator on the page")
