"""The planner with a policy: its decisions, vetoes, and the fixed rule that takes over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from gtsam import Pose2, Pose3, Rot3

from drivers.shadow.closing.posture import HandShape
from sessions.conductor.decisions import DoGrasp, End, Pause, UndoGrasp
from sessions.conductor.estimator_client import LocalClient
from sessions.conductor.policy_decisions import PolicyDecisions, Proposal, approve_everything
from sessions.guided.attended import AttendedDecisions
from sessions.guided.operator import Ask, Panel, Request
from sessions.motion.probing.bounding_box import BoundingBox
from tactile_lab.autonomy.hand_candidates import (
    OUT_OF_REACH,
    offer,
)
from tactile_lab.autonomy.heuristic_planner import HeuristicPlanner, PlanSettings
from tactile_lab.autonomy.planner import Planner
from tactile_lab.autonomy.policy_choice import Choice
from tactile_lab.autonomy.slam_service import SlamService
from tactile_lab.autonomy.variance_planner import ExplorationSettings
from tactile_lab.slam.doubt.assessment import Assessment
from tactile_lab.slam.shape.fields.gpis import Gpis
from tests.support.box_shapes import FLAT_BOX, HEIGHT_m
from tests.support.hand_limits import chooser, limits


@dataclass
class KnownSlam:
    """An estimation that knows a box."""

    x_m: float = 0.0
    is_lost: bool = False
    origin_height_m: float = HEIGHT_m

    @property
    def surface(self) -> Gpis:
        return FLAT_BOX.field

    @property
    def surface_grasps(self) -> np.ndarray:
        return np.arange(len(FLAT_BOX.field.contacts_m)) // 5

    @property
    def world_T_object(self) -> Pose3:
        return Pose3(Rot3(), np.array([self.x_m, 0.0, HEIGHT_m]))

    @property
    def pose_covariance(self) -> np.ndarray:
        return 1e-6 * np.eye(3)

    def assess(self, shape: object) -> Assessment:
        return Assessment("complete", None, 1.0, (), ())


def planner(policy: str = "variance", grasps: int = 10, slam: KnownSlam | None = None) -> Planner:
    rule = HeuristicPlanner(PlanSettings(), np.random.default_rng(0))
    return Planner(
        slam or KnownSlam(),  # type: ignore[arg-type]
        rule,
        ExplorationSettings(),
        1,
        HandShape(),
        2,
        chooser(policy),
        grasps,
    )


def estimator(made: Planner) -> LocalClient:
    return LocalClient(SlamService(KnownSlam(), made))  # type: ignore[arg-type]


def decisions(made: Planner, approve: object = None) -> tuple[PolicyDecisions, list[Choice]]:
    told: list[Choice] = []
    if approve is None:
        return PolicyDecisions(estimator(made), told.append), told
    return PolicyDecisions(estimator(made), told.append, approve), told  # type: ignore[arg-type]


def test_the_policy_is_asked_after_the_fixed_grasps_and_its_decision_is_told_once() -> None:
    who, told = decisions(planner())
    who.prepare(0)
    assert isinstance(who.decide(0), DoGrasp)
    assert told == []
    who.prepare(1)
    decision = who.decide(1)
    assert isinstance(decision, DoGrasp)
    assert decision.plan.reason.startswith("variance: ")
    who.decide(1)
    assert [choice.number for choice in told] == [2]


def test_the_policy_chooses_below_the_top_that_was_felt() -> None:
    made = planner()
    made.on_bounding_box(BoundingBox(Pose2(), np.zeros(2), np.zeros(2), 0.0, 0.022, {}, has_sides=False))
    assert [made.plan(index).height_m for index in (0, 1)] == [0.015, 0.015]


def test_a_veto_takes_the_next_best_and_is_recorded() -> None:
    asked: list[Proposal] = []

    def refuse_two(proposal: Proposal) -> bool:
        asked.append(proposal)
        return proposal.vetoed == 2

    who, told = decisions(planner(), refuse_two)
    who.prepare(1)
    decision = who.decide(1)
    assert isinstance(decision, DoGrasp)
    assert len({proposal.plan.frame for proposal in asked} | {p.plan.closing for p in asked}) >= 2
    assert decision.plan == asked[-1].plan
    assert "vetoed by the operator" in decision.plan.reason
    assert len(told[0].vetoed) == 2
    scores = told[0].decision.scores
    assert scores[told[0].vetoed[0]] >= scores[told[0].vetoed[1]] >= scores[told[0].decision.chosen or 0]


def test_when_all_are_vetoed_the_fixed_rule_stands_in_and_says_why() -> None:
    candidates = len(offer(limits(), FLAT_BOX, Pose2()).usable)
    who, _ = decisions(planner(), lambda proposal: proposal.vetoed > candidates)
    who.prepare(1)
    decision = who.decide(1)
    assert isinstance(decision, DoGrasp)
    assert "vetoed" in decision.plan.reason


def test_grasps_of_the_fixed_rule_may_be_vetoed_too() -> None:
    who, told = decisions(planner(), lambda proposal: proposal.vetoed == 1)
    who.prepare(0)
    decision = who.decide(0)
    assert isinstance(decision, DoGrasp)
    assert "vetoed" in decision.plan.reason
    assert told == []


def test_without_a_reachable_candidate_the_rule_stands_in_and_says_why() -> None:
    made = planner(slam=KnownSlam(x_m=0.6))
    plan = made.plan(1)
    assert OUT_OF_REACH in plan.reason
    assert plan.reason.startswith("alternating yaw, as ")


def test_a_policy_that_stops_ends_the_session_with_its_reason() -> None:
    who, told = decisions(planner(grasps=1))
    who.prepare(1)
    decision = who.decide(1)
    assert isinstance(decision, End)
    assert "budget" in decision.reason
    assert told[0].decision.outcome == "stop"


class Presser:
    """A person at the page, who presses one thing each time he is asked."""

    attended = False

    def __init__(self, *asks: Ask | None) -> None:
        self._asks = list(asks)

    def requests(self) -> Sequence[Request]:
        ask = self._asks.pop(0) if self._asks else None
        return [] if ask is None else [Request(ask)]

    def show(self, panel: Panel) -> None:
        """Not looked at."""


def test_attended_session_records_and_approves_the_policys_decisions_too() -> None:
    told: list[Choice] = []
    person = Presser(Ask.PAUSE, None, Ask.PAUSE)
    who = AttendedDecisions(estimator(planner()), told.append, lambda proposal: proposal.vetoed == 1, person)
    who.prepare(1)
    assert isinstance(who.decide(1), Pause)
    assert isinstance(who.decide(1), Pause)
    assert told == []
    assert isinstance(who.decide(1), DoGrasp)
    assert [(choice.number, len(choice.vetoed)) for choice in told] == [(2, 1)]


def test_attended_session_is_ended_or_set_back_at_its_page() -> None:
    who = AttendedDecisions(estimator(planner()), lambda choice: None, approve_everything, Presser(Ask.UNDO, Ask.END))
    undone, ended = who.decide(3), who.decide(2)
    assert isinstance(undone, UndoGrasp)
    assert undone.reason == "by the operator on the page"
    assert isinstance(ended, End)
    assert ended.reason == "ended by the operator on the page after 2 grasps"


def test_attended_session_ends_when_its_policy_stops() -> None:
    told: list[Choice] = []
    who = AttendedDecisions(estimator(planner(grasps=1)), told.append, approve_everything, Presser())
    who.prepare(1)
    assert isinstance(who.decide(1), End)
    assert told[0].decision.outcome == "stop"
