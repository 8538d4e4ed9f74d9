"""Decisions of a session that follows a policy: each is recorded completely, and a person may veto it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from sessions.conductor.decisions import AutonomousDecisions, Decision, End
from sessions.conductor.estimator import EstimatorService, PolicyChoice
from sessions.conductor.estimator_client import EstimatorClient
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.safety import InterruptGuard
from sessions.recording.recorder import Level
from sessions.rig_runtime.rig_runtime import RigRuntime


@dataclass(frozen=True)
class Proposal:
    """The proposed next grasp.

    Attributes:
        number: from 1.
        plan: the grasp and its reason.
        vetoed: number of plans for this grasp vetoed so far.
        weighs: the object is held at this plan already, and would be dragged and lifted a little.
        withdrawn: whether the answer no longer matters because Ctrl+C ends the session.
    """

    number: int
    plan: GraspPlan
    vetoed: int = 0
    weighs: bool = False
    withdrawn: Callable[[], bool] = lambda: False


Approve = Callable[[Proposal], bool]
"""Asks a person before each grasp whether to execute it."""


def approve_everything(proposal: Proposal) -> bool:
    """Asks nobody."""
    return True


class PolicyDecisions(AutonomousDecisions):
    """The planner's policy decides.

    Args:
        estimator: client of a planner with or without a policy.
        tell: receives every decision of the policy once.
        approve: asked before every grasp; a vetoed grasp is replaced by the next best.
        guard: receives Ctrl+C, which withdraws the question.
    """

    def __init__(
        self,
        estimator: EstimatorClient,
        tell: Callable[[PolicyChoice], None],
        approve: Approve = approve_everything,
        guard: InterruptGuard | None = None,
    ) -> None:
        super().__init__(estimator)
        self._tell, self._approve, self._guard = tell, approve, guard or InterruptGuard()
        self._untold: PolicyChoice | None = None

    def prepare(self, index: int) -> None:
        super().prepare(index)
        vetoed = 0
        while not (self._is_over or self._is_approved(index, vetoed) or self._guard.requested):
            self._planned, vetoed = self.estimator.ask(EstimatorService.replan, index), vetoed + 1
        self._untold = self._choice

    def _is_approved(self, index: int, vetoed: int) -> bool:
        """Whether the person, if one is asked, approves the planned grasp."""
        if self._planned is None or self._planned.search is not None:
            return True
        return self._asked(Proposal(index + 1, self._planned.plan, vetoed, withdrawn=lambda: self._guard.requested))

    def may_weigh(self, plan: GraspPlan) -> bool:
        return self._asked(Proposal(0, plan, weighs=True, withdrawn=lambda: self._guard.requested))

    def _asked(self, proposal: Proposal) -> bool:
        """Whether the person agrees, if one is asked."""
        if self._approve is approve_everything:
            return True
        return self.estimator.wait_for_person(lambda: self._approve(proposal))

    def decide(self, index: int) -> Decision:
        if (choice := self._untold) is not None:
            self._untold = None
            self._tell(choice)
        if self._is_over and self._choice is not None:
            return End(self._choice.reason)
        return super().decide(index)

    @property
    def _choice(self) -> PolicyChoice | None:
        """The policy's decision about the next grasp."""
        return None if self._planned is None else self._planned.choice

    @property
    def _is_over(self) -> bool:
        """Whether the policy expects no further gain."""
        return self._choice is not None and self._choice.is_over


def record_choices(runtime: RigRuntime) -> Callable[[PolicyChoice], None]:
    """Writes decisions into a rig runtime's recording: complete for programs, and as a sentence for people."""

    def tell(choice: PolicyChoice) -> None:
        now_ns = runtime.clock.now_ns()
        runtime.recorder.decision(now_ns, choice.as_plain())
        runtime.log(Level.WARNING if choice.failure else Level.INFO, "policy", choice.sentence())

    return tell
