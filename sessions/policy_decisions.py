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
from sessions.grasp_cycle import GraspPlan
from sessions.hand_candidates import HandLimits
from sessions.next_grasp import PlanSettings
from sessions.planner import Planner
from sessions.policy_choice import Choice, PolicyChooser
from sessions.recorder import Level
from sessions.safety import SafetySettings
from tactile_lab.exploration.policies import make_policy
from tactile_lab.tracking.motion import MotionNoise


@dataclass(frozen=True)
class Proposal:
    """The grasp that would come next.

    Attributes:
        number: from 1.
        plan: what would be done, and why.
        vetoed: how many plans for this grasp have been refused already.
    """

    number: int
    plan: GraspPlan
    vetoed: int = 0


Approve = Callable[[Proposal], bool]
"""Whether a person lets a grasp be done; asked before each."""


def everything_approved(proposal: Proposal) -> bool:
    """Nobody is asked."""
    return True


class PolicyDecisions(AutonomousDecisions):
    """The planner's policy decides.

    Args:
        planner: with or without a policy.
        tell: told every decision of the policy once, from the session's own thread.
        approve: asked before every grasp; what it refuses is replaced by the next best.
    """

    def __init__(
        self, planner: Planner, tell: Callable[[Choice], None], approve: Approve = everything_approved
    ) -> None:
        super().__init__(planner)
        self._tell, self._approve = tell, approve
        self._untold: Choice | None = None

    def think(self, index: int) -> None:
        super().think(index)
        vetoed = 0
        while not self._is_over and self._plan is not None:
            if self._approve(Proposal(index + 1, self._plan, vetoed)):
                break
            self._plan, vetoed = self.planner.vetoed(index), vetoed + 1
        self._untold = self.planner.choice

    def decide(self, index: int) -> Decision:
        if (choice := self._untold) is not None:
            self._untold = None
            self._tell(choice)
        if self._is_over and self.planner.choice is not None:
            return End(self.planner.choice.decision.reason)
        return super().decide(index)

    @property
    def _is_over(self) -> bool:
        """Whether the policy has nothing more to gain."""
        choice = self.planner.choice
        return choice is not None and choice.decision.outcome == "stop"


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
    return PolicyChooser(make_policy(policy), limits, noise, np.random.default_rng([seed, 1]))
