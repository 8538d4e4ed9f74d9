"""Decisions of a session that follows a policy: each is recorded with all it was about, and a person may veto it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from drivers.shadow.posture import TipEllipsoid
from sessions.bench import Bench
from sessions.cycle_settings import CycleSettings
from sessions.decisions import AutonomousDecisions, Decision, End
from sessions.explorer import ExplorationSettings
from sessions.grasp_plan import GraspPlan
from sessions.hand_candidates import HandLimits
from sessions.next_grasp import PlanSettings
from sessions.policy_choice import Choice, PolicyChooser
from sessions.recorder import Level
from sessions.safety import InterruptGuard, SafetySettings
from sessions.thinker import Thinker
from sessions.thinking import Thinking
from tactile_lab.exploration.policies import make_policy
from tactile_lab.tracking.motion import MotionNoise


@dataclass(frozen=True)
class Proposal:
    """The grasp that would come next.

    Attributes:
        number: from 1.
        plan: what would be done, and why.
        vetoed: how many plans for this grasp have been refused already.
        withdrawn: whether the answer does not matter any more: Ctrl+C ends the session.
    """

    number: int
    plan: GraspPlan
    vetoed: int = 0
    withdrawn: Callable[[], bool] = lambda: False


Approve = Callable[[Proposal], bool]
"""Whether a person lets a grasp be done; asked before each."""


def everything_approved(proposal: Proposal) -> bool:
    """Nobody is asked."""
    return True


class PolicyDecisions(AutonomousDecisions):
    """The planner's policy decides.

    Args:
        thinking: where a planner with or without a policy is asked.
        tell: told every decision of the policy once.
        approve: asked before every grasp; what it refuses is replaced by the next best.
        guard: hears Ctrl+C, which withdraws what was asked.
    """

    def __init__(
        self,
        thinking: Thinking,
        tell: Callable[[Choice], None],
        approve: Approve = everything_approved,
        guard: InterruptGuard | None = None,
    ) -> None:
        super().__init__(thinking)
        self._tell, self._approve, self._guard = tell, approve, guard or InterruptGuard()
        self._untold: Choice | None = None

    def think(self, index: int) -> None:
        super().think(index)
        vetoed = 0
        while not (self._is_over or self._is_approved(index, vetoed) or self._guard.requested):
            self._thought, vetoed = self.thinking.ask(Thinker.vetoed, index), vetoed + 1
        self._untold = self._choice

    def _is_approved(self, index: int, vetoed: int) -> bool:
        """Whether a person, where one is asked, lets the grasp be done that has been thought of."""
        if self._thought is None or self._approve is everything_approved:
            return True
        proposal = Proposal(index + 1, self._thought.plan, vetoed, lambda: self._guard.requested)
        return self.thinking.beside(lambda: self._approve(proposal))

    def decide(self, index: int) -> Decision:
        if (choice := self._untold) is not None:
            self._untold = None
            self._tell(choice)
        if self._is_over and self._choice is not None:
            return End(self._choice.decision.reason)
        return super().decide(index)

    @property
    def _choice(self) -> Choice | None:
        """The policy's, about the grasp that comes next."""
        return None if self._thought is None else self._thought.choice

    @property
    def _is_over(self) -> bool:
        """Whether the policy has nothing more to gain."""
        return self._choice is not None and self._choice.decision.outcome == "stop"


def recorded_by(bench: Bench) -> Callable[[Choice], None]:
    """Puts decisions into a bench's recording, whole for programs and in a sentence for people."""

    def tell(choice: Choice) -> None:
        now_ns = bench.clock.now_ns()
        bench.recorder.decision(now_ns, choice.as_plain())
        bench.event(Level.INFO, "policy", choice.sentence())

    return tell


def chooser_for(
    policy: str,
    settings: tuple[PlanSettings, ExplorationSettings, CycleSettings, SafetySettings],
    tip: TipEllipsoid,
    dimension: int,
    noise: MotionNoise,
    seed: int,
) -> PolicyChooser:
    """The policy called ``policy`` over what the hand can do. Raises ConfigurationError if there is none."""
    plan, exploration, cycle, safety = settings
    limits = HandLimits(plan, exploration, cycle, safety, tip, dimension)
    return PolicyChooser(make_policy(policy, exploration.information), limits, noise, np.random.default_rng([seed, 1]))
