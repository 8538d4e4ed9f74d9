"""Policies at work: what the hand offers, the planner with a policy, vetoes, the record; on fakes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from gtsam import Pose2, Pose3, Rot3

from drivers.core.contacts import Contact, Grasp
from drivers.shadow.closing.closing import closing
from drivers.shadow.closing.posture import HandShape
from sessions.conductor.decisions import DoGrasp, End, Pause
from sessions.conductor.estimator_client import LocalClient
from sessions.conductor.policy_decisions import PolicyDecisions, Proposal, approve_everything
from sessions.guided.attended import AttendedDecisions
from sessions.guided.operator import Ask, Panel, Request
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.safety import SafetySettings
from tactile_lab.autonomy.hand_candidates import (
    LANDED,
    NO_ROOM,
    OUT_OF_REACH,
    TOO_HIGH,
    TOO_TALL,
    HandLimits,
    HasRoom,
    anywhere,
    grasp_time_s,
    offer,
)
from tactile_lab.autonomy.heuristic_planner import HeuristicPlanner, PlanSettings
from tactile_lab.autonomy.planner import Planner
from tactile_lab.autonomy.policy_choice import Choice, Knowledge, PolicyChooser
from tactile_lab.autonomy.regrasp_planner import with_contacts
from tactile_lab.autonomy.slam_service import SlamService
from tactile_lab.autonomy.variance_planner import ExplorationSettings, KnownShape, known_shape
from tactile_lab.slam.doubt.assessment import Assessment
from tactile_lab.slam.exploration.candidates import Candidate, ModelledObject, predict_contacts
from tactile_lab.slam.exploration.policies import POLICIES, make_policy
from tactile_lab.slam.exploration.policy import Belief, Decision, best_of, nothing_to_choose
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tests.support.box_shapes import FLAT_BOX, SOLID_BOX, HEIGHT_m, flat_box
from tests.support.rectangle_world import modelled

YAWS, SHIFTS, CLOSINGS, HEIGHTS, LEANING_HEIGHTS = 12, 7, 2, 3, 2
IN_PLANE = YAWS * SHIFTS * CLOSINGS


def limits(dimension: int = 2, **changes: object) -> HandLimits:
    made = HandLimits(PlanSettings(), ExplorationSettings(), CycleSettings(), SafetySettings(), HandShape(), dimension)
    return replace(made, **changes)  # type: ignore[arg-type]


# --- what the hand offers ------------------------------------------------------------------------------------------


def test_every_yaw_shift_and_closing_is_considered() -> None:
    found = offer(limits(), FLAT_BOX, Pose2())
    assert len(found.usable) + sum(found.ruled_out.values()) == IN_PLANE
    assert {one.plan.closing for one in found.usable} == {"pinch", "radial"}
    assert not any(one.plan.tap for one in found.usable)


def test_in_space_heights_and_taps_come_on_top() -> None:
    found = offer(limits(3), SOLID_BOX, Pose2())
    assert (
        len(found.usable) + sum(found.ruled_out.values())
        == IN_PLANE * HEIGHTS + YAWS * CLOSINGS + YAWS * SHIFTS * LEANING_HEIGHTS
    )
    assert {one.plan.height_m for one in found.usable} == {0.018, 0.026, 0.034}
    assert found.ruled_out[TOO_HIGH] == IN_PLANE  # the box is 40 mm high, and the third height 48
    taps = [one for one in found.usable if one.plan.tap]
    assert taps
    assert len({len(one.candidate.rays.fingers) for one in found.usable}) == 1  # policies compare like with like
    plain = next(one for one in found.usable if not one.plan.tap and one.plan.frame == taps[0].plan.frame)
    assert taps[0].candidate.time_s > plain.candidate.time_s + 2.0


def test_a_leaning_hand_is_offered_in_space_and_expected_to_touch_at_several_heights() -> None:
    aside = [one for one in offer(limits(3), SOLID_BOX, Pose2()).usable if one.plan.closing == "aside"]
    assert aside
    assert not any(one.plan.tap for one in aside)
    along = min(aside, key=lambda one: abs(abs(one.plan.frame.yaw_rad) - np.pi / 2))
    known = ModelledObject(SOLID_BOX.field, 3, Pose2(), SOLID_BOX.origin_height_m)
    heights_m = predict_contacts(along.candidate, known).points_object_m[:, 2]
    assert len(heights_m) >= 3
    assert np.ptp(heights_m) > 0.009


def test_a_tap_is_expected_on_the_top() -> None:
    found = offer(limits(3), SOLID_BOX, Pose2())
    tap = next(one for one in found.usable if one.plan.tap)
    belief = Belief(
        SOLID_BOX.field,
        SOLID_BOX.surface,
        SOLID_BOX.field.contacts_m,
        SOLID_BOX.field.normals,
        np.zeros(len(SOLID_BOX.field.contacts_m), dtype=np.int64),
        Pose2(),
    )
    expected = predict_contacts(tap.candidate, modelled(belief))
    heights = expected.points_object_m[:, 2]
    assert np.count_nonzero(np.abs(heights - 0.04) < 0.003) >= 3


def test_object_out_of_reach_offers_nothing_and_says_so() -> None:
    found = offer(limits(), FLAT_BOX, Pose2(0.6, 0.0, 0.0))
    assert found.usable == ()
    assert found.ruled_out == {OUT_OF_REACH: IN_PLANE}
    assert found.obstacles == f"{IN_PLANE}: {OUT_OF_REACH}"


def test_object_too_large_for_the_opening_offers_nothing() -> None:
    huge = flat_box(0.09, 0.09)
    found = offer(limits(), huge, Pose2())
    assert found.usable == ()
    assert found.ruled_out[NO_ROOM] == IN_PLANE


def test_object_as_high_as_the_palm_offers_nothing() -> None:
    found = offer(limits(3), replace(SOLID_BOX, top_height_m=0.14), Pose2())
    assert found.usable == ()
    assert found.ruled_out[TOO_TALL] > 0


def test_places_the_hand_has_landed_at_are_ruled_out() -> None:
    found = offer(limits(), FLAT_BOX, Pose2(), has_room=lambda plan: plan.closing == "pinch")
    assert {one.plan.closing for one in found.usable} == {"pinch"}
    assert found.ruled_out[LANDED] == IN_PLANE // 2


def test_fingers_come_down_clear_of_what_bulges_above_them() -> None:
    """On a sphere's equator higher than the fingertips there is less room than at their own height."""
    for one in offer(limits(3), SOLID_BOX, Pose2()).usable:
        paths = closing(one.plan.closing, one.plan.height_m, HandShape()).paths
        tips = np.array([one.plan.frame.pose.transformFrom(p.centre_m(p.valid[0])) for p in paths.values()])
        outside = np.linalg.norm(np.maximum(np.abs(tips[:, :2]) - [0.05, 0.03], 0.0), axis=1)
        assert outside.min() > 0.008


def test_grasps_with_links_on_the_object_are_marked() -> None:
    """A hand with its fingertips at 34 mm has room above a box of 4 cm, and rests on one of 7 cm."""

    def marked(top_m: float) -> list[bool]:
        found = offer(limits(plan=PlanSettings(contour_top_m=top_m)), FLAT_BOX, Pose2())
        return [one.candidate.pushes for one in found.usable]

    assert np.mean(marked(0.04)) < 0.5
    assert np.mean(marked(0.07)) > 0.9


def test_information_counts_less_where_links_push() -> None:
    one, known = chooser("information"), knowledge()
    tall = PolicyChooser(
        one.policy, limits(plan=PlanSettings(contour_top_m=0.2)), MotionNoise(), np.random.default_rng(0)
    )
    low = PolicyChooser(
        one.policy, limits(plan=PlanSettings(contour_top_m=0.01)), MotionNoise(), np.random.default_rng(0)
    )
    spoilt, whole = (each.choose(3, known) for each in (tall, low))
    assert spoilt.decision.scores == pytest.approx([0.55 * score for score in whole.decision.scores])
    assert spoilt.decision.reason.endswith("though it may push the object")
    assert not whole.decision.reason.endswith("though it may push the object")
    assert all(one["pushes"] for one in spoilt.as_plain()["candidates"])


def test_time_grows_with_the_way_to_the_grasp() -> None:
    plan = GraspPlan(GraspFrame(0.0, 0.0, 1.0), "pinch", HEIGHT_m)
    near = grasp_time_s(plan, CycleSettings(), GraspFrame(0.0, 0.0, 0.9))
    far = grasp_time_s(plan, CycleSettings(), GraspFrame(0.0, 0.0, -1.2))
    assert far - near == pytest.approx((2.2 - 0.1) / 1.5)


# --- the chooser ---------------------------------------------------------------------------------------------------


def knowledge(known: KnownShape = FLAT_BOX, left: int | None = 5, x_m: float = 0.0) -> Knowledge:
    count = len(known.field.contacts_m)
    return Knowledge(known, Pose2(x_m, 0.0, 0.2), 1e-6 * np.eye(3), np.arange(count) // 5, left)


def chooser(policy: str = "variance", dimension: int = 2) -> PolicyChooser:
    return PolicyChooser(make_policy(policy), limits(dimension), MotionNoise(), np.random.default_rng(0))


@pytest.mark.parametrize("name", sorted(POLICIES))
def test_every_policy_chooses_among_the_hands_candidates(name: str) -> None:
    choice = chooser(name).choose(3, knowledge())
    assert choice.decision.outcome == "grasp"
    assert choice.plan is not None
    assert choice.plan.reason.startswith(f"{name}: ")
    assert len(choice.decision.scores) == len(choice.offered.usable)


@pytest.mark.parametrize("name", ["random", "variance", "clusters", "information"])
def test_policies_work_in_space_with_taps(name: str) -> None:
    choice = chooser(name, 3).choose(3, knowledge(SOLID_BOX))
    assert choice.decision.outcome == "grasp"


def test_no_candidate_is_told_with_its_obstacles() -> None:
    choice = chooser().choose(3, knowledge(x_m=0.6))
    assert choice.plan is None
    assert choice.decision.outcome == "nothing"
    assert OUT_OF_REACH in choice.decision.reason


def test_budget_of_zero_stops() -> None:
    choice = chooser().choose(3, knowledge(left=0))
    assert choice.decision.outcome == "stop"
    assert "budget" in choice.decision.reason


@dataclass(frozen=True)
class Indifferent:
    """All candidates are the same to it."""

    name: str = "indifferent"

    def choose(self, candidates: Sequence[Candidate], belief: Belief, rng: np.random.Generator) -> Decision:
        if settled := nothing_to_choose(self.name, candidates, belief):
            return settled
        return best_of(self.name, np.ones(len(candidates)), "all tell the same", rng)


def test_equal_candidates_are_chosen_by_chance_and_it_says_so() -> None:
    choice = PolicyChooser(Indifferent(), limits(), MotionNoise(), np.random.default_rng(0)).choose(3, knowledge())
    assert choice.plan is not None
    assert "chance" in choice.decision.reason


def touching(*fingers: str) -> Grasp:
    contacts = [
        Contact(f, np.array([0.03, 0.0, 0.02]), np.array([1.0, 0, 0]), 1e-6 * np.eye(3), 0.05, 0.5) for f in fingers
    ]
    return Grasp(2, 0, tuple(contacts), Pose3())


def test_fingers_that_met_nothing_are_remembered_where_they_were_expected() -> None:
    one, known = chooser("information"), knowledge()
    choice = one.choose(3, known)
    one.on_decision(choice, known)
    expected = predict_contacts(
        choice.offered.usable[choice.decision.chosen or 0].candidate, modelled(one._belief(known))
    )
    one.on_grasp(touching(*expected.fingers[1:]))
    missed = one._belief(known).missed_m
    np.testing.assert_allclose(missed, expected.points_object_m[:1], atol=1e-6)


def test_where_a_grasp_fits_nowhere_is_not_tried_for_ever() -> None:
    one, known = chooser("information"), knowledge()
    choice = one.choose(3, known)
    one.on_decision(choice, known)
    candidate = choice.offered.usable[choice.decision.chosen or 0].candidate
    expected = predict_contacts(candidate, modelled(one._belief(known)))
    one.on_grasp(touching(*expected.fingers))
    assert len(one._belief(known).missed_m) == 0
    one.on_unplaced_grasp()
    np.testing.assert_allclose(one._belief(known).missed_m, expected.points_object_m, atol=1e-6)
    one.on_grasp(touching())  # a grasp that no policy chose: nothing was expected of it
    one.on_unplaced_grasp()
    assert len(one._belief(known).missed_m) == len(expected.fingers)


def test_a_region_that_never_yields_contact_is_given_up() -> None:
    """A candidate whose fingers have met nothing again and again is not chosen for ever."""
    one, known = chooser("information"), knowledge()
    chosen = []
    for number in range(6):
        choice = one.choose(number, known)
        chosen.append(choice.decision.chosen)
        one.on_decision(choice, known)
        one.on_grasp(touching())
    assert len(set(chosen)) > 1


def test_turns_keep_the_hand_in_its_window() -> None:
    one = chooser()
    for yaw in (-1.2, 0.0, 1.2):
        turn = one.turn(GraspFrame(0.0, 0.0, yaw), knowledge(), touching("FF", "TH"), 0.3)
        assert turn is not None
        assert -1.31 <= yaw + turn <= 1.31
        assert 0.2 < abs(turn) < 0.8


def turn_of_a_box_with_untouched_sides(
    window_rad: tuple[float, float],
    closings: tuple[str, ...],
    noise: MotionNoise = MotionNoise(translation_m=0.002, rotation_rad=0.05),  # noqa: B008
    has_room: HasRoom = anywhere,
) -> float | None:
    """What becomes of a box in a hand at yaw 0.4; one contact each tells where its sides along x are."""
    along = np.linspace(-0.03, 0.03, 13)
    ends = [np.column_stack([np.full(13, x), along]) for x in (0.03, -0.03)]
    points = np.vstack([*ends, [[0.0, 0.03], [0.0, -0.03]]])
    normals = np.repeat([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]], [13, 13, 1, 1], axis=0)
    field = Gpis.fit(points, normals, 0.001, 0.05)
    known = known_shape(field, 2, HEIGHT_m, ExplorationSettings())
    found = Knowledge(known, Pose2(), 1e-6 * np.eye(3), np.zeros(len(field.contacts_m), dtype=int), 5)
    hand = limits(plan=PlanSettings(yaw_window_rad=window_rad, closings=closings, contour_top_m=0.03))
    one = PolicyChooser(make_policy("information"), hand, noise, np.random.default_rng(0))
    return one.turn(GraspFrame(0.0, 0.0, 0.4), found, Grasp(2, 0, (), Pose3()), 0.3, has_room)


def test_an_object_is_left_unless_what_is_unknown_of_it_is_out_of_reach() -> None:
    assert turn_of_a_box_with_untouched_sides((-1.31, 1.31), ("pinch", "radial")) is None
    turn = turn_of_a_box_with_untouched_sides((-0.4, 0.4), ("pinch",))
    assert turn is not None
    assert turn < -0.2


def test_an_object_that_is_in_the_way_where_it_lies_is_turned() -> None:
    window, closings = (-1.31, 1.31), ("pinch", "radial")
    assert turn_of_a_box_with_untouched_sides(window, closings, has_room=lambda plan: False) is not None


def test_knowledge_of_the_pose_is_worth_less_than_sides_that_nothing_else_reaches() -> None:
    """One grasp does not win back what a carry costs here; several on sides that were out of reach do."""
    rough = MotionNoise(translation_m=0.007, rotation_rad=0.2)
    assert turn_of_a_box_with_untouched_sides((-0.4, 0.4), ("pinch",), rough) is not None
    assert turn_of_a_box_with_untouched_sides((-1.31, 1.31), ("pinch", "radial"), rough) is None


def test_contacts_of_the_grasp_in_hand_count_when_a_turn_is_chosen() -> None:
    known = knowledge()
    belief = chooser("information")._belief(known)
    grasp = touching("FF", "TH")
    seen = with_contacts(belief, grasp)
    assert len(seen.contacts_m) == len(belief.contacts_m) + 2
    assert np.count_nonzero(seen.latest_contacts) == 2
    back = np.array([known.world_T_object.transformFrom(point) for point in seen.contacts_m[-2:]])
    np.testing.assert_allclose(back, grasp.points_world_m[:, :2], atol=1e-12)
    assert np.linalg.norm(seen.normals[-1]) == pytest.approx(1.0)


def test_nothing_touches_the_underside() -> None:
    surface = SOLID_BOX.surface
    assert surface is not None
    touchable = surface.touchable(0.0)
    assert surface.points_m[touchable][:, 2].min() > 0.0
    assert touchable[surface.points_m[:, 2] > 0.03].all()
    assert not touchable[surface.normals[:, 2] < -0.8].any()
    assert surface.touchable(0.2)[surface.normals[:, 2] > -0.5].all()  # high over the table all but what faces down


def test_record_is_plain_json_with_all_candidates() -> None:
    choice = chooser().choose(3, knowledge())
    document = json.loads(json.dumps(choice.as_plain(), allow_nan=False))
    assert document["number"] == 3
    assert len(document["candidates"]) == len(choice.offered.usable)
    assert document["candidates"][document["chosen"]]["score"] == max(
        one["score"] for one in document["candidates"] if one["score"] is not None
    )


# --- the planner with a policy, and vetoes -------------------------------------------------------------------------


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


def test_attended_session_ends_when_its_policy_stops() -> None:
    told: list[Choice] = []
    who = AttendedDecisions(estimator(planner(grasps=1)), told.append, approve_everything, Presser())
    who.prepare(1)
    assert isinstance(who.decide(1), End)
    assert told[0].decision.outcome == "stop"
