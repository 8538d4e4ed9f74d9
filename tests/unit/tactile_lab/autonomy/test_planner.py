"""Choosing grasps: candidates around an estimate, landings, doubt, and the rule that stands in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from gtsam import Pose2, Pose3, Rot3

from drivers.core.contacts import FINGERS, Array, Contact, Grasp
from drivers.shadow.closing.closing import Closing, closing
from drivers.shadow.closing.posture import HandShape
from sessions.motion.cycle_settings import TouchSettings
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.probing.bounding_box import BoundingBox
from sessions.perception.hand_odometry import HandMotion
from tactile_lab.autonomy.clearance.felt_outline import FeltOutline
from tactile_lab.autonomy.heuristic_planner import HeuristicPlanner, PlanSettings
from tactile_lab.autonomy.planner import Planner
from tactile_lab.autonomy.variance_planner import (
    ExplorationSettings,
    KnownShape,
    choose_grasp,
    closing_rays,
    known_shape,
)
from tactile_lab.slam.exploration.candidates import Candidate, ModelledObject, predict_contacts
from tactile_lab.slam.shape.fields.gpis import Gpis

WINDOW_rad = (-1.3, 1.3)
SETTINGS = ExplorationSettings()


def box_field(sides: str = "nesw") -> Gpis:
    """A field of a 100 x 60 mm box, touched on the given sides only."""
    along = np.linspace(-0.045, 0.045, 7)
    across = np.linspace(-0.025, 0.025, 5)
    walls = {
        "n": (np.column_stack([along, np.full(7, 0.03)]), (0.0, 1.0)),
        "s": (np.column_stack([along, np.full(7, -0.03)]), (0.0, -1.0)),
        "e": (np.column_stack([np.full(5, 0.05), across]), (1.0, 0.0)),
        "w": (np.column_stack([np.full(5, -0.05), across]), (-1.0, 0.0)),
    }
    points = np.vstack([walls[side][0] for side in sides])
    normals = np.vstack([np.tile(walls[side][1], (len(walls[side][0]), 1)) for side in sides])
    return Gpis.fit(points, normals, 0.001, 0.05)


def shape_of(field: Gpis) -> KnownShape:
    return known_shape(field, 2, 0.022, SETTINGS)


def table(name: str) -> Closing:
    return closing(name, 0.022)


def choose(
    shape: KnownShape,
    pose: Pose2 | None = None,
    has_room: Callable[[GraspPlan], bool] = lambda plan: True,
    settings: ExplorationSettings = SETTINGS,
) -> GraspPlan | None:
    return choose_grasp(shape, pose or Pose2(), ("pinch", "radial"), table, WINDOW_rad, settings, has_room)


def test_explored_share_grows_with_the_sides_touched() -> None:
    shares = [shape_of(box_field(sides)).explored for sides in ("ns", "nse", "nsew")]
    assert shares[0] < shares[1] < shares[2]
    assert shares[2] > 0.7


def test_middle_of_the_shape() -> None:
    np.testing.assert_allclose(shape_of(box_field()).centre_m, [0, 0], atol=2e-3)


def test_grasp_stands_around_the_object_where_it_is_now() -> None:
    pose = Pose2(0.05, -0.03, 0.7)
    plan = choose(shape_of(box_field()), pose)
    assert plan is not None
    assert np.hypot(plan.frame.x_m - 0.05, plan.frame.y_m + 0.03) < 0.02
    assert WINDOW_rad[0] <= plan.frame.yaw_rad <= WINDOW_rad[1]


def test_fingers_go_where_the_surface_is_not_known() -> None:
    """With both long sides known, the reward is in the short ones: fingers close around an end."""
    shape = shape_of(box_field("ns"))
    plan = choose(shape)
    assert plan is not None
    assert "contacts expected" in plan.reason
    place = Pose2(plan.frame.x_m, plan.frame.y_m, plan.frame.yaw_rad)
    candidate = Candidate(place, plan.closing, closing_rays(table(plan.closing)))
    expected = predict_contacts(candidate, ModelledObject(shape.field, 2, Pose2(), shape.origin_height_m))
    assert np.count_nonzero(np.abs(expected.points_object_m[:, 0]) > 0.048) >= 2


def test_open_fingertips_keep_clear_of_the_object() -> None:
    plan = choose(shape_of(box_field()))
    assert plan is not None
    paths = table(plan.closing).paths
    for finger in FINGERS:
        start_m = np.asarray(plan.frame.pose.transformFrom(paths[finger].centre_m(paths[finger].valid[0])))
        outside = np.maximum(np.abs(start_m[:2]) - [0.05, 0.03], 0.0)
        assert np.linalg.norm(outside) > 0.008


def test_no_candidate_without_room() -> None:
    assert choose(shape_of(box_field()), has_room=lambda plan: False) is None
    assert choose(shape_of(box_field()), settings=ExplorationSettings(clearance_m=0.5)) is None


def test_most_contacts_win_when_none_promises_enough() -> None:
    plan = choose(shape_of(box_field()), settings=ExplorationSettings(least_contacts=9))
    assert plan is not None
    assert plan.reason.startswith("5 contacts")


# --- the planner -------------------------------------------------------------------------------------------------


@dataclass
class KnownSlam:
    """An estimation that knows a box."""

    surface: Gpis | None
    world_T_object: Pose3 | None = None
    is_lost: bool = False
    origin_height_m: float = 0.022


def planner(slam: KnownSlam, fixed_grasps: int = 1, dimension: int = 2) -> Planner:
    rule = HeuristicPlanner(PlanSettings(), np.random.default_rng(0))
    touches = TouchSettings() if dimension == 3 else None
    return Planner(slam, rule, SETTINGS, fixed_grasps, HandShape(), dimension, touches=touches)  # type: ignore[arg-type]


def known_slam(x: float = 0.0, y: float = 0.0) -> KnownSlam:
    return KnownSlam(box_field(), Pose3(Rot3(), np.array([x, y, 0.022])))


def grasp_at(*fingers: str, x: float = 0.03) -> Grasp:
    contacts = tuple(
        Contact(f, np.array([-x if f == "TH" else x, 0.0, 0.02]), np.array([1.0, 0, 0]), 1e-6 * np.eye(3), 0.05, 0.5)
        for f in fingers
    )
    return Grasp(0, 0, contacts, Pose3())


def open_tips_m(plan: GraspPlan) -> Array:
    paths = table(plan.closing).paths
    starts = [plan.frame.pose.transformFrom(paths[f].centre_m(paths[f].valid[0])) for f in FINGERS]
    return np.array(starts)


def test_first_grasps_follow_the_rule_then_the_estimate_chooses() -> None:
    chooser = planner(known_slam())
    assert chooser.plan(0).reason == "alternating yaw"
    assert "contacts expected" in chooser.plan(1).reason


@pytest.mark.parametrize("slam", [KnownSlam(None), KnownSlam(box_field()), KnownSlam(box_field(), Pose3(), True)])
def test_rule_stands_in_where_nothing_is_known_or_all_is_lost(slam: KnownSlam) -> None:
    assert planner(slam).plan(5).reason == "alternating yaw"


def test_an_outline_is_felt_where_the_hand_had_room_from_then_on() -> None:
    chooser = planner(KnownSlam(None, None), fixed_grasps=9)
    plan = replace(chooser.plan(0), may_rise=True)
    raised = plan.raised(0.0121, np.inf)
    assert raised is not None
    assert raised.height_m == pytest.approx(plan.height_m + 0.013)
    chooser.on_grasp(grasp_at("FF", "TH"), raised)
    assert {chooser.plan(index).height_m for index in range(1, 5)} == {raised.height_m}


def test_an_outline_is_felt_higher_only_where_other_ways_down_to_it_were_blocked() -> None:
    chooser = planner(KnownSlam(None, None), fixed_grasps=9)
    for _ in range(3):
        plan = chooser.plan(0)
        assert plan.raised(0.01, np.inf) is None
        chooser.on_landings([np.array([0.0, 0.0, 0.05])])
    assert chooser.plan(0).raised(0.01, np.inf) is not None
    assert chooser.replan(0).raised(0.01, np.inf) is not None
    chooser.on_grasp(grasp_at("FF", "TH"), plan)
    assert chooser.plan(1).raised(0.01, np.inf) is None


def test_after_a_veto_an_outline_is_felt_as_high_as_before() -> None:
    chooser = planner(KnownSlam(None, None), fixed_grasps=9)
    chooser.on_grasp(grasp_at("FF", "TH"), replace(chooser.plan(0), height_m=0.047))
    assert chooser.replan(1).height_m == 0.047


def test_a_grasp_that_closed_above_the_object_does_not_raise_those_that_follow() -> None:
    chooser = planner(KnownSlam(None, None), fixed_grasps=9)
    plan = chooser.plan(0)
    chooser.on_grasp(grasp_at(), replace(plan, height_m=0.119))
    assert chooser.plan(1).height_m == plan.height_m


def test_a_grasp_from_the_side_of_something_tall_does_not_raise_those_that_follow() -> None:
    chooser = planner(KnownSlam(None, None), fixed_grasps=9)
    sides_m = np.array([0.03, 0.03])
    chooser.on_bounding_box(BoundingBox(Pose2(), -sides_m, sides_m, 0.0, 0.15, {}))
    first = chooser.plan(0)
    assert first.closing.endswith(("left", "right"))
    chooser.on_grasp(grasp_at("FF", "TH"), replace(first, height_m=0.11))
    assert chooser.plan(1).height_m < 0.11


def test_a_surface_is_felt_at_all_heights_whatever_was_raised() -> None:
    chooser = planner(KnownSlam(None, None), fixed_grasps=9, dimension=3)
    raised = replace(chooser.plan(0), height_m=0.047)
    chooser.on_grasp(grasp_at("FF", "TH"), raised)
    assert min(chooser.plan(index).height_m for index in range(1, 5)) < 0.047


def test_estimate_is_carried_with_the_hand() -> None:
    chooser = planner(known_slam())
    chooser.on_carry(HandMotion(Pose3(Rot3(), np.array([0.1, 0.0, 0.0]))))
    chooser.on_estimate(3, True)
    np.testing.assert_allclose(chooser.centre_m, [0.1, 0.0], atol=3e-3)
    assert abs(chooser.plan(4).frame.x_m - 0.1) < 0.03


def test_no_fingertip_comes_down_again_where_one_has_landed() -> None:
    chooser = planner(known_slam())
    first = chooser.plan(1)
    landed = [open_tips_m(first)[0]]
    chooser.on_landings(landed)
    for index in (0, 1):  # by the rule and by the estimate
        apart_m = np.linalg.norm(open_tips_m(chooser.plan(index))[:, :2] - landed[0][:2], axis=1)
        assert apart_m.min() >= 0.020


def test_landings_are_forgotten_when_the_object_was_moved_and_no_sooner() -> None:
    chooser = planner(known_slam())
    first = chooser.plan(1)
    chooser.on_landings([open_tips_m(first)[0]])
    chooser.on_carry(HandMotion(Pose3()))
    assert np.linalg.norm(open_tips_m(chooser.plan(1)) - open_tips_m(first), axis=1).max() > 0.01
    chooser.on_carry(HandMotion(Pose3(Rot3(), np.array([1e-6, 0.0, 0.0]))))
    np.testing.assert_allclose(open_tips_m(chooser.plan(1)), open_tips_m(first), atol=1e-5)


FROM_ABOVE = {"alternating yaw", "a yaw with room for the hand"}


def block_the_way_down(chooser: Planner) -> None:
    for _ in range(2):
        plan = chooser.plan(4)
        assert plan.reason in FROM_ABOVE
        chooser.on_landings([open_tips_m(plan)[0]])


def test_what_blocked_the_way_down_is_touched_once_and_then_grasped_from_above_again() -> None:
    chooser = planner(KnownSlam(None), dimension=3)
    block_the_way_down(chooser)
    beside = chooser.plan(4)
    assert beside.reason not in FROM_ABOVE
    chooser.on_grasp(grasp_at("FF"), beside)
    assert chooser.plan(5).reason in FROM_ABOVE


def test_a_session_goes_on_from_above_when_nothing_beside_the_object_is_left() -> None:
    chooser = planner(KnownSlam(None), dimension=3)
    block_the_way_down(chooser)
    for _ in range(200):
        if (plan := chooser.plan(4)).reason in FROM_ABOVE:
            break
        chooser.on_landings([plan.frame.pose.translation()])
    assert plan.reason in FROM_ABOVE
    assert not chooser.exhausted


def felt_on_top(top_m: float) -> Planner:
    chooser = planner(KnownSlam(None), dimension=3)
    chooser.on_bounding_box(BoundingBox(Pose2(), np.zeros(2), np.zeros(2), 0.0, top_m, {}, has_sides=False))
    return chooser


def test_fingers_that_met_nothing_close_at_another_height_before_the_top_is_tapped_on() -> None:
    chooser = felt_on_top(0.07)
    first = chooser.plan(0)
    chooser.on_grasp(grasp_at(), first)
    second = chooser.plan(1)
    assert (second.frame, second.closing, second.only_touch) == (first.frame, first.closing, False)
    assert abs(second.height_m - first.height_m) > 0.008
    chooser.on_grasp(grasp_at(), second)
    tap = chooser.plan(2)
    assert tap.only_touch
    chooser.on_grasp(Grasp(2, 0, (replace(grasp_at("FF").contacts[0], probed=True),), Pose3()), tap)
    assert chooser.plan(3).reason in FROM_ABOVE


def test_a_touch_that_met_nothing_is_neither_repeated_at_another_height_nor_followed_by_a_tap() -> None:
    chooser = felt_on_top(0.07)
    chooser.on_grasp(grasp_at("FF", "TH"), chooser.plan(0))
    chooser.on_grasp(grasp_at(), replace(chooser.plan(1), only_touch=True))
    assert chooser.plan(2).reason in FROM_ABOVE


def test_a_wide_rim_above_a_waist_is_met_by_fingers_just_below_it() -> None:
    chooser = felt_on_top(0.07)
    chooser.on_grasp(grasp_at(), replace(chooser.plan(0), height_m=0.034))
    assert 0.055 < chooser.plan(1).height_m < 0.065


def test_where_the_other_height_is_blocked_or_there_is_none_the_top_is_tapped_on() -> None:
    chooser = felt_on_top(0.07)
    chooser.on_grasp(grasp_at(), chooser.plan(0))
    chooser.on_landings([open_tips_m(chooser.plan(1))[0]])
    assert chooser.plan(1).only_touch
    low = felt_on_top(0.02)
    low.on_grasp(grasp_at(), low.plan(0))
    assert low.plan(1).only_touch


def test_a_top_that_was_never_felt_is_not_tapped_on() -> None:
    chooser = planner(KnownSlam(None), dimension=3)
    chooser.on_grasp(grasp_at(), chooser.plan(0))
    assert chooser.plan(1).reason in FROM_ABOVE


def test_estimate_that_missed_the_object_is_doubted_for_one_grasp() -> None:
    chooser = planner(known_slam())
    plan = chooser.plan(1)
    chooser.on_grasp(grasp_at("FF", "MF", "TH"), plan)
    assert chooser.plan(2).reason == "alternating yaw"
    chooser.on_grasp(grasp_at("FF", "MF", "TH"), plan)
    assert "contacts expected" in chooser.plan(3).reason


def test_reorientation_keeps_the_window_and_brings_the_object_back() -> None:
    chooser = planner(known_slam())
    wanted = chooser.on_grasp(grasp_at("MF", "TH", x=0.03), GraspPlan(chooser.plan(0).frame, "pinch", 0.022))
    assert 0.2 <= abs(wanted.turn_rad) <= 0.8
    assert np.linalg.norm(wanted.shift_world_m) <= 0.03


def round_a_long_box(half_m: float = 0.06) -> Grasp:
    contacts = tuple(
        Contact(f, np.array([x, y, 0.034]), np.array([np.sign(x), 0, 0]), 1e-6 * np.eye(3), 0.05, 0.5)
        for f, x, y in (("FF", half_m, 0.02), ("LF", half_m, -0.02), ("TH", -half_m, 0.0))
    )
    return Grasp(0, 0, contacts, Pose3())


def test_the_rule_turns_or_rises_where_links_would_be_in_what_was_felt() -> None:
    chooser = planner(KnownSlam(None, None), fixed_grasps=9)
    chooser.on_grasp(round_a_long_box(), replace(chooser.plan(0), frame=GraspFrame(0.0, 0.0, 0.0)))
    found = chooser.plan(1)
    felt = FeltOutline(HandShape())
    felt.on_grasp(round_a_long_box())
    assert felt.is_clear(found, 0.05)
    assert not felt.is_clear(replace(found, frame=GraspFrame(0.0, 0.0, 0.0), height_m=0.034), 0.05)


def test_contacts_of_a_grasp_that_is_undone_are_in_no_way() -> None:
    chooser = planner(KnownSlam(None, None), fixed_grasps=9)
    chooser.on_grasp(round_a_long_box(), chooser.plan(0))
    assert {chooser.plan(index).reason for index in range(1, 9)} != {"alternating yaw"}
    chooser.on_undo(Pose3())
    assert {chooser.plan(index).reason for index in range(1, 9)} == {"alternating yaw"}
