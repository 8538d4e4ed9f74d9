"""An autonomous session with someone at the page: between grasps he may pause it, take a grasp back, or end it."""

from __future__ import annotations

from collections.abc import Callable

from sessions.conductor.decisions import Decision, End, Pause, UndoGrasp
from sessions.conductor.estimator import PolicyChoice
from sessions.conductor.estimator_client import EstimatorClient
from sessions.conductor.policy_decisions import Approve, PolicyDecisions
from sessions.guided.operator import Ask, Operator
from sessions.motion.safety import InterruptGuard


class AttendedDecisions(PolicyDecisions):
    """The planner's decisions, recorded and approved as ever, unless the person asks for something else.

    Args:
        estimator: where a planner with or without a policy is asked.
        tell: told every decision of the policy that is not overtaken by what the person asks for.
        approve: asked before every grasp.
        operator: the person; is heard between grasps.
        guard: hears Ctrl+C.
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
                return UndoGrasp("by the person at the page")
            elif request.ask is Ask.END:
                return End(f"ended by the person at the page after {index} grasps")
        if not self._paused:
            return super().decide(index)
        self._wait()
        return Pause("by the person at the page")
