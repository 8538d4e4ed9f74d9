"""The tables of a report: loops, grasps, stops, decisions, evaluation, provenance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drivers.core.configuration import flatten_keys
from drivers.core.contacts import Array
from tactile_lab.evaluation.files.properties_file import MeasuredBody
from tactile_lab.evaluation.inertia import PrincipalInertia
from tactile_lab.evaluation.loops import first_in_map
from tactile_lab.evaluation.table import UNKNOWN, EvaluationRow, evaluation_rows
from tactile_lab.report import figures
from tactile_lab.report.content import ReportContent
from tactile_lab.report.course import Course, PolicyDecision
from tactile_lab.report.legend import legend
from tactile_lab.report.markup import Markup, badge, element, figure, join, table
from tactile_lab.report.uncertainty_figures import calibration_curve

_ANY_deg = 30.0
"""An axis that may be turned farther is any: two moments cannot be told apart."""


def number(value: float | None, digits: int = 1) -> str:
    """A number with this many digits, a dash if it is unknown."""
    return UNKNOWN if value is None else f"{value:.{digits}f}"


def loops_card(content: ReportContent) -> Markup:
    """Loop candidates (similar grasps) and the outcome of their tests."""
    loops = content.results.slam["loops"]
    if not loops:
        text = element("p", "No grasp was similar enough to an earlier one to be tested.", class_="lead")
        return element("div", element("h3", "Similar grasps"), text, class_="card")
    born = first_in_map(content.results.trajectory.world_T_object)
    rows = [_loop_row(loop, born) for loop in loops]
    titles = ["grasps", "faces", "test value", "verdict", "reason"]
    accepted = sum(bool(loop["accepted"]) for loop in loops)
    told = f"{accepted} of {len(loops)} were accepted into the pose graph."
    return element(
        "div",
        element("h3", "Similar grasps"),
        element("p", told, class_="lead"),
        element("div", table(titles, rows, (0, 3, 4)), class_="tall"),
        class_="card",
    )


def _loop_row(loop: Mapping[str, Any], born: int) -> list[str | Markup]:
    verdict = badge("accepted", "good") if loop["accepted"] else badge("refused", "warn")
    return [
        f"{born + loop['earlier'] + 1} \u2013 {born + loop['later'] + 1}",
        str(loop["faces"]),
        number(loop["test_value"]),
        verdict,
        str(loop["reason"]),
    ]


def body_card(measured: MeasuredBody) -> Markup:
    """Centre of mass and principal axes of inertia of an object that was weighed."""
    if measured.centre_m is None and measured.inertia is None:
        return Markup("")
    parts = [element("h3", "Mass inside the object")]
    if measured.centre_m is not None:
        x_mm, y_mm, two_sigma_mm = (1e3 * float(each) for each in (*measured.centre_m, 2 * measured.centre_sigma_m))
        text = f"Centre of mass, as weighed: x {x_mm:.1f}, y {y_mm:.1f} ± {two_sigma_mm:.1f} mm (two σ)."
        parts.append(element("p", text, class_="lead"))
    if measured.inertia is not None:
        titles = ["axis", "moment of inertia, kg cm²", "σ, kg cm²", "direction x, y, z", "σ, °"]
        note = "About the centre of mass, if the estimated shape is evenly filled; σ does not know of hollow objects."
        parts += [table(titles, _inertia_rows(measured.inertia)), element("p", note, class_="note")]
    return element("div", *parts, class_="card wide")


def _inertia_rows(inertia: PrincipalInertia) -> list[list[str]]:
    kg_cm2 = np.column_stack([inertia.moments_kg_m2, inertia.moments_sigma_kg_m2]) * 1e4
    turns_deg = np.degrees(inertia.axes_sigma_rad)
    return [
        [
            str(axis + 1),
            *(f"{each:.3g}" for each in kg_cm2[axis]),
            _direction(inertia.axes[axis]),
            _turn(turns_deg[axis]),
        ]
        for axis in range(3)
    ]


def _direction(axis: Array) -> str:
    return ", ".join(f"{each:+.2f}" for each in np.round(axis, 2) + 0.0)  # no -0.00


def _turn(sigma_deg: float) -> str:
    return "any" if sigma_deg > _ANY_deg else f"{sigma_deg:.0f}"


def grasp_section(content: ReportContent) -> Markup:
    """Forces, and one line per grasp."""
    picture = figures.force_map(content)
    parts = [element("h2", "Grasps")]
    if picture is not None:
        readable = element("div", Markup(picture), class_="scroll broad")
        parts.append(figure(readable, "In newtons; a dashed cell is a finger that did not touch.", "Contact forces"))
    rows = [_grasp_row(content, index) for index in range(len(content.results.contacts))]
    titles = ["grasp", "time, s", "contacts", "verdict", "reason", "σ, mm", "σ, °", "error, mm", "error, °"]
    note = "σ is the estimated standard deviation of position and heading; the error is relative to the marker camera."
    parts.append(element("div", table(titles, rows, (0, 3, 4)), element("p", note, class_="note"), class_="card wide"))
    return join(parts)


_VERDICTS = {"first": "good", "tracked": "good", "uncertain": "warn", "untracked": "bad"}


def _grasp_row(content: ReportContent, index: int) -> list[str | Markup]:
    """One grasp: time, contacts, estimate, error."""
    results = content.results
    step: Mapping[str, Any] = _entry(results.slam["steps"], index)
    error: Mapping[str, Any] = _entry(((content.evaluation or {}).get("pose") or {}).get("per_grasp"), index)
    sigma_mm, sigma_deg = content.pose_sigma(index)
    verdict = str(step.get("verdict", UNKNOWN))
    return [
        str(index + 1),
        f"{results.trajectory.stamps_s[index]:.1f}",
        f"{step.get('contacts_used', UNKNOWN)} of {len(results.contacts[index].fingers)}",
        badge(verdict, _VERDICTS.get(verdict, "warn")),
        str(step.get("reason", "")),
        number(sigma_mm, 2),
        number(sigma_deg, 2),
        number(error.get("mm"), 2),
        number(error.get("deg"), 2),
    ]


def _entry(entries: Sequence[Mapping[str, Any] | None] | None, index: int) -> Mapping[str, Any]:
    """An entry of a list that may be too short or contain nulls."""
    return (entries[index] if entries and index < len(entries) else None) or {}


def evaluation_section(content: ReportContent) -> Markup:
    """The evaluation as a table with the meaning of each metric."""
    parts = [element("h2", "Evaluation")]
    if content.evaluation is None:
        return join([*parts, element("p", "The session has not been evaluated. Run: tactile-lab evaluate SESSION")])
    rows = [_evaluation_row(row) for row in evaluation_rows(content.evaluation)]
    parts.append(element("div", table(["figure", "value", "meaning"], rows, (0, 2)), class_="card"))
    curve = calibration_curve(content.evaluation.get("consistency") or {})
    if curve is not None:
        caption = (
            "Share of true values inside the stated regions, over the probability stated for them. On the dotted line "
            "the uncertainties are true; below it they are too small, above it too large."
        )
        keys = legend([("estimate", "surface"), ("truth", "poses")])
        parts.append(element("div", figure(curve, caption, "Are the uncertainties true?", keys), class_="pair wide"))
    return join(parts)


def _evaluation_row(row: EvaluationRow) -> list[str | Markup]:
    value = join((row.value, element("span", row.unit, class_="unit") if row.unit else Markup("")))
    return [row.label, value, row.note]


def origin_section(content: ReportContent) -> Markup:
    """How the session was made: seeds, versions, calibrations, and all settings of the estimation."""
    rows = [[name, element("code", value)] for name, value in content.facts.made_with]
    rows += [[f"calibration: {role}", element("code", digest)] for role, digest in content.facts.calibrations]
    named = flatten_keys(content.results.slam.get("settings") or {})
    settings = [[name, element("code", str(value))] for name, value in named if not isinstance(value, Mapping)]
    folded = element(
        "details", element("summary", "Settings of the estimation"), table(["setting", "value"], settings, (0, 1))
    )
    card = element("div", table(["item", "value"], rows, (0, 1)), folded if settings else "", class_="card wrap")
    return join([element("h2", "How it was made"), card])


_OUTCOMES = {"stop": ("ended the session", "good"), "nothing": ("no grasp", "warn")}
_NOTE = (
    "Position and rotation of the hand on the table; score and expected gain in the policy\u2019s own unit, higher is "
    "better; feasible candidates of all; candidates vetoed by a person."
)


def stops_card(course: Course) -> Markup:
    """When and why everything was stopped; empty if it was not."""
    if not course.stops:
        return Markup("")
    lines = [element("li", element("b", f"at {stop.time_s:.1f} s"), f"  {stop.cause}") for stop in course.stops]
    heading = element("h3", badge("stopped", "bad"), " All motion was stopped, with zero demands to the hand")
    return element("div", heading, element("ul", *lines), class_="card wide")


def decisions_card(course: Course) -> Markup:
    """One line per decision of the exploration policy; empty without a policy."""
    if not course.decisions:
        return Markup("")
    titles = ["grasp", "closing", "x, mm", "y, mm", "turn, \u00b0", "score", "gain", "candidates", "vetoed", "reason"]
    policies = ", ".join(dict.fromkeys(decision.policy for decision in course.decisions))
    return element(
        "div",
        element("h3", "Choice of the grasps"),
        element("p", f"Policy: {policies}. Grasps that are not listed followed the fixed rule.", class_="lead"),
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
    """Closing, position, rotation and score of the chosen grasp; the outcome if there is none."""
    chosen = decision.chosen
    if chosen is None:
        return [badge(*_OUTCOMES.get(decision.outcome, (decision.outcome, "warn"))), *[UNKNOWN] * 4]
    place = [f"{1e3 * chosen.x_m:.0f}", f"{1e3 * chosen.y_m:.0f}", f"{math.degrees(chosen.yaw_rad):.0f}"]
    return [chosen.closing, *place, _figures(chosen.score)]


def _figures(value: float | None) -> str:
    """Three significant figures: the units of policies differ by orders of magnitude."""
    return UNKNOWN if value is None else f"{value:.3g}"
