"""What the planner's answers become: waiting, a grasp, or the end of the session."""

from __future__ import annotations

from typing import Any, cast

import pytest

from sessions.conductor.decisions import AutonomousDecisions, DoGrasp, End, Wait
from sessions.conductor.estimator import PlannedGrasp
from sessions.conductor.estimator_client import EstimatorClient
from sessions.motion.grasp_plan import GraspPlan

PLAN = cast(GraspPlan, object())


class Answering:
    """An estimator that plans what it is told to, and counts how often it is asked for the object's centre."""

    def __init__(self, exhausted: str = "") -> None:
        self.planned, self.questions = PlannedGrasp(PLAN, None, exhausted), list[str]()

    def ask(self, question: Any, *_: object) -> object:
        self.questions.append(question.__name__)
        return self.planned if question.__name__ == "plan" else [0.0, 0.0]


def decisions(estimator: Answering) -> AutonomousDecisions:
    return AutonomousDecisions(cast(EstimatorClient, estimator))


def test_before_anything_is_planned_the_session_waits() -> None:
    made = decisions(Answering())
    assert (made.suggested, made.decide(0)) == (None, Wait())


def test_a_plan_is_done() -> None:
    made = decisions(Answering())
    made.prepare(0)
    assert made.suggested is PLAN
    assert made.decide(0) == DoGrasp(PLAN)


def test_a_planner_with_nothing_left_ends_the_session_as_partial() -> None:
    made = decisions(Answering("nothing left that the hand can reach"))
    made.prepare(3)
    assert made.decide(3) == End("nothing left that the hand can reach", partial=True)


@pytest.mark.parametrize("news", ["on_undo", "on_estimate", "on_carry", "on_bounding_box", "on_capture"])
def test_the_centre_is_asked_for_anew_after_news_only(news: str) -> None:
    estimator = Answering()
    made = decisions(estimator)
    assert made.centre_m is made.centre_m
    getattr(made, news)(*[cast(Any, None)] * {"on_undo": 0, "on_capture": 2}.get(news, 1))
    assert made.centre_m is not None
    assert estimator.questions.count("centre_m") == 2
