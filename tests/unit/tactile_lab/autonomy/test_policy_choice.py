"""Policies at work: what the hand offers, the planner with a policy, vetoes, the record; on fakes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from gtsam import Pose2, Pose3, Rot3

from drivers.core.contacts import Contact, Grasp, StepSigma
from sessions.motion.grasp_frame import GraspFrame
from sessions.perception.hand_odometry import HandMotion
from tactile_lab.autonomy.hand_candidates import (
    OUT_OF_REACH,
    HasRoom,
    anywhere,
)
from tactile_lab.autonomy.heuristic_planner import PlanSettings
from tactile_lab.autonomy.policy_choice import Knowledge, PolicyChooser
from tactile_lab.autonomy.regrasp_planner import with_contacts
from tactile_lab.autonomy.variance_planner import ExplorationSettings, known_shape
from tactile_lab.slam.exploration.candidates import Candidate, predict_contacts
from tactile_lab.slam.exploration.policies import POLICIES, make_policy
from tactile_lab.slam.exploration.policy import Belief, Decision, best_of, nothing_to_choose
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tests.support.box_shapes import SOLID_BOX, HEIGHT_m
from tests.support.hand_limits import chooser, knowledge, limits
from tests.support.rectangle_world import modelled


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


def test_a_carry_that_was_felt_leaves_the_pose_better_known() -> None:
    one, before = chooser("information"), 1e-6 * np.eye(3)
    carried = Pose3(Rot3(), np.array([0.01, 0.0, 0.0]))
    assert one.spread(before, HandMotion()) is before
    felt = one.spread(before, HandMotion(carried, StepSigma(0.0005, 0.01)))
    np.testing.assert_allclose(felt - before, np.diag([0.0005, 0.0005, 0.01]) ** 2)
    assert (np.diag(one.spread(before, HandMotion(carried))) > np.diag(felt)).all()


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
