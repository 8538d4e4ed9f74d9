"""What a person is asked before a grasp, and before the object that is held is weighed."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from sessions.conductor.decisions import DoGrasp, End
from sessions.conductor.estimator import EstimatorService, PlannedGrasp
from sessions.conductor.policy_decisions import PolicyDecisions, Proposal
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan


def plan(reason: str) -> GraspPlan:
    return GraspPlan(GraspFrame(0.0, 0.0, 0.0), "pinch", 0.02, reason)


class Planner:
    """Plans one grasp, and another one whenever that is vetoed."""

    def __init__(self, over: bool = False) -> None:
        self.replanned, self.over = 0, over

    def ask(self, question: Callable[..., Any], index: int) -> PlannedGrasp:
        self.replanned += question is EstimatorService.replan
        choice = SimpleNamespace(is_over=self.over, reason="nothing to gain")
        return PlannedGrasp(plan(f"plan {self.replanned}"), choice)  # type: ignore[arg-type]

    def wait_for_person(self, question: Callable[[], bool]) -> bool:
        return question()


def test_a_vetoed_plan_is_replaced_until_one_is_approved() -> None:
    asked: list[Proposal] = []
    told: list[Any] = []

    def approve(proposal: Proposal) -> bool:
        asked.append(proposal)
        return len(asked) == 3

    decisions = PolicyDecisions(Planner(), told.append, approve)  # type: ignore[arg-type]
    decisions.prepare(4)
    assert [(each.number, each.vetoed, each.weighs, each.plan.reason) for each in asked] == [
        *((5, 0, False, "plan 0"), (5, 1, False, "plan 1"), (5, 2, False, "plan 2")),
    ]
    assert not asked[0].withdrawn()
    decision = decisions.decide(4)
    assert isinstance(decision, DoGrasp)
    assert decision.plan.reason == "plan 2"
    decisions.decide(4)
    assert len(told) == 1  # each choice once


def test_weighing_is_asked_for_by_itself() -> None:
    asked: list[Proposal] = []
    decisions = PolicyDecisions(Planner(), lambda choice: None, lambda one: bool(asked.append(one)))  # type: ignore[arg-type]
    assert not decisions.may_weigh(plan("held"))
    assert [(each.number, each.vetoed, each.weighs) for each in asked] == [(0, 0, True)]
    assert PolicyDecisions(Planner(), lambda choice: None).may_weigh(plan("held"))  # type: ignore[arg-type]


def test_a_policy_that_is_over_asks_nobody_and_ends() -> None:
    asked: list[Proposal] = []
    decisions = PolicyDecisions(Planner(over=True), lambda choice: None, lambda one: bool(asked.append(one)))  # type: ignore[arg-type]
    decisions.prepare(0)
    assert decisions.decide(0) == End("nothing to gain")
    assert asked == []
