"""The course of a session in a report: what stopped it, and why each grasp was chosen."""

from __future__ import annotations

import math

from tactile_lab.evaluation.table import UNKNOWN
from tactile_lab.report.course import Course, PolicyDecision
from tactile_lab.report.markup import Markup, badge, element, table

_OUTCOMES = {"stop": ("ended the session", "good"), "nothing": ("no grasp", "warn")}
_NOTE = (
    "Place and turn of the hand on the table; score and promised gain in the policy\u2019s own unit, the higher the "
    "better; candidates that could be used, of all; those that a person vetoed."
)


def stops_card(course: Course) -> Markup:
    """When and why everything was stopped; nothing where it was not."""
    if not course.stops:
        return Markup("")
    lines = [element("li", element("b", f"at {stop.time_s:.1f} s"), f"  {stop.cause}") for stop in course.stops]
    heading = element("h3", badge("stopped", "bad"), " Everything was stopped, zero demands to the hand")
    return element("div", heading, element("ul", *lines), class_="card wide")


def decisions_card(course: Course) -> Markup:
    """One line a decision of the exploration policy; nothing where no policy decided."""
    if not course.decisions:
        return Markup("")
    titles = ["grasp", "closing", "x, mm", "y, mm", "turn, \u00b0", "score", "gain", "candidates", "vetoed", "reason"]
    policies = ", ".join(dict.fromkeys(decision.policy for decision in course.decisions))
    return element(
        "div",
        element("h3", "Why these grasps"),
        element("p", f"Policy: {policies}. Grasps without a line here followed the fixed rule.", class_="lead"),
        table(titles, map(_row, course.decisions), (0, 1, 9)),
        element("p", _NOTE, class_="note"),
        class_="card wide",
    )


def _row(decision: PolicyDecision) -> list[str | Markup]:
    everything = decision.candidates + sum(decision.ruled_out.values())
    return [
        str(decision.number),
        *_chosen(decision),
        _figures(decision.promised_gain),
        f"{decision.candidates} of {everything}",
        str(decision.vetoed),
        decision.reason,
    ]


def _chosen(decision: PolicyDecision) -> list[str | Markup]:
    """Closing, place, turn and score of the chosen grasp; what came instead where there is none."""
    chosen = decision.chosen
    if chosen is None:
        return [badge(*_OUTCOMES.get(decision.outcome, (decision.outcome, "warn"))), *[UNKNOWN] * 4]
    place = [f"{1e3 * chosen.x_m:.0f}", f"{1e3 * chosen.y_m:.0f}", f"{math.degrees(chosen.yaw_rad):.0f}"]
    return [chosen.closing, *place, _figures(chosen.score)]


def _figures(value: float | None) -> str:
    """Three significant figures: the units of policies differ by orders of magnitude."""
    return UNKNOWN if value is None else f"{value:.3g}"
