"""Grasps from the side: clear of box and table, deep, new each time, and an end with its reason."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose2, Pose3

from drivers.core.contacts import Contact, Grasp
from drivers.shadow.closing.closing import closing
from drivers.shadow.closing.hand_envelope import open_hand
from drivers.shadow.closing.posture import HandShape
from sessions.conductor.estimator import Change
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.probing.bounding_box import BoundingBox
from tactile_lab.autonomy.heuristic_planner import HeuristicPlanner, PlanSettings
from tactile_lab.autonomy.planner import Planner
from tactile_lab.autonomy.standing.candidate import SideReach, approach_of
from tactile_lab.autonomy.standing.felt_object import FeltObject
from tactile_lab.autonomy.standing.planner import StandingPlanner
from tactile_lab.autonomy.standing.side_clearance import StandingBox, expected_closing, is_way_clear
from tactile_lab.autonomy.variance_planner import ExplorationSettings

TIP = HandShape()
WINDOW_rad = (-1.31, 1.31)
NOTHING = np.empty((0, 3))


def box(width_m: float = 0.066, length_m: float = 0.105, top_m: float = 0.187, turn_rad: float = 0.3) -> BoundingBox:
    high = np.array([width_m, length_m]) / 2
    return BoundingBox(Pose2(0.01, 0.0, turn_rad), -high, high, 0.008, top_m, {})


def planner(felt: BoundingBox) -> StandingPlanner:
    """Without touches."""
    return StandingPlanner(FeltObject(felt), TIP, WINDOW_rad, SideReach())


def grasp(points_m: np.ndarray, fingers: list[str]) -> Grasp:
    """Contacts on the sides of the box that :func:`box` is."""
    low, turn = np.array([0.033, 0.0525]), Pose2(0.01, 0.0, 0.3)
    inside = np.array([turn.transformTo(point[:2]) for point in points_m]).reshape(-1, 2)
    beyond = np.abs(inside) - low
    own = np.where(beyond == beyond.max(axis=1, keepdims=True), np.sign(inside), 0.0)
    normals = np.array([[*turn.rotation().matrix() @ normal, 0.0] for normal in own])
    contacts = tuple(
        Contact(finger, point, normal, 1e-6 * np.eye(3), 0.1, 0.4)
        for finger, point, normal in zip(fingers, points_m, normals, strict=True)
    )
    return Grasp(0, 0, contacts, Pose3(), Pose3())


def standing(felt: BoundingBox) -> StandingBox:
    x, y = felt.centre_world_m
    length_m, width_m = felt.high_m - felt.low_m
    assert felt.top_m is not None
    return StandingBox(float(x), float(y), felt.world_T_box.theta(), (float(length_m), float(width_m), felt.top_m))


def test_distances_of_a_standing_box() -> None:
    upright = StandingBox(0.1, 0.0, np.pi / 2, (0.2, 0.1, 0.3))
    places = np.array([[0.1, 0.0, 0.15], [0.1, 0.13, 0.15], [0.19, 0.0, 0.15], [0.1, 0.0, 0.34]])
    np.testing.assert_allclose(upright.distances_m(places), [-0.05, 0.03, 0.04, 0.04], atol=1e-12)
    assert upright.half_along_m(np.array([1.0, 0.0])) == pytest.approx(0.05)


def test_a_plan_is_clear_on_its_way_and_thumb_and_fingers_meet_the_box() -> None:
    felt = box()
    plan = planner(felt).plan()
    assert plan is not None
    assert closing(plan.closing, plan.height_m, TIP).is_sideways
    assert is_way_clear(plan, TIP, standing(felt))
    expected = expected_closing(plan, TIP, standing(felt), standing(felt))
    assert expected.holds
    touches = expected.touches
    assert len(touches) >= 4
    assert np.abs(standing(felt).distances_m(np.array(list(touches.values())))).max() < 0.006


def test_a_way_through_the_box_and_a_hand_in_the_table_are_not_clear() -> None:
    upright = StandingBox(0.0, 0.0, 0.0, (0.066, 0.105, 0.187))
    too_deep = GraspPlan(GraspFrame(0.0, -0.06, 0.0), "pinch-from-left", 0.06)
    assert not is_way_clear(too_deep, TIP, upright)
    too_low = GraspPlan(GraspFrame(0.0, 0.2, 0.0), "pinch-from-right", 0.016)
    assert open_hand(too_low.closing, too_low.height_m, TIP).lowest_m < 0.0
    assert not is_way_clear(too_low, TIP, upright)


def test_next_grasp_is_where_nothing_was_touched_until_nothing_is_left() -> None:
    """A hand that touches what it expects to: every height of both broad sides comes, and then the end."""
    beside, heights = planner(box(top_m=0.13)), []
    for _ in range(30):
        plan = beside.plan()
        if plan is None:
            break
        touches = expected_closing(plan, TIP, standing(beside.felt.box), standing(beside.felt.box)).touches
        heights += [place[2] for place in touches.values()]
        beside.on_grasp(grasp(np.array(list(touches.values())), list(touches)))
    assert plan is None
    assert min(heights) < 0.045
    assert max(heights) > 0.10
    assert max(np.diff(sorted(heights))) < 0.03
    assert beside.exhausted.startswith("nothing left that the hand can reach: ")
    assert "mm high" in beside.exhausted


def all_grasps(felt: BoundingBox) -> list[GraspPlan]:
    return [one.plan for one in planner(felt)._grasping._candidates()]


def test_what_is_unsteady_is_held_gently_and_never_by_a_hand_that_comes_to_its_broad_side() -> None:
    slender, stout = all_grasps(box(0.045, 0.097, 0.177, -0.37)), all_grasps(box(0.070, 0.070, 0.120))
    assert slender
    assert stout
    assert {plan.is_gentle for plan in slender} == {True}
    assert {plan.is_gentle for plan in stout} == {False}
    thin = Pose2(0.0, 0.0, -0.37).rotation().matrix()[:, 0]
    assert max(abs(thin @ approach_of(plan, TIP)) for plan in slender) < 0.1
    assert {plan.is_gentle for plan in all_grasps(box(0.050, 0.050, 0.190))} == {True}, "unsteady all around"


def test_a_finger_whose_link_would_land_stays_open_and_the_others_hold() -> None:
    """What is 80 mm wide is hardly entered: the little finger's links would meet its edge before the fingertip."""
    upright = StandingBox(0.0, 0.0, 0.0, (0.08, 0.10, 0.11))
    found = planner(BoundingBox(Pose2(), np.array([-0.04, -0.05]), np.array([0.04, 0.05]), 0.0, 0.11, {}))
    plans = [one.plan for one in found._grasping._candidates()]
    assert any(plan.stays_open for plan in plans)
    for plan in plans:
        expected = expected_closing(plan, TIP, upright, upright)
        assert expected.stays_open <= plan.stays_open, "the planner's box is a little larger"
        assert len(expected.touches.keys() - plan.stays_open) >= 3
        assert "TH" not in plan.stays_open


def test_what_becomes_narrower_upward_is_entered_deeper_than_its_foot_allows() -> None:
    """The same foot as above, with contacts on all sides higher up that say it is 50 mm wide there."""
    foot, body = np.array([0.04, 0.05]), np.array([0.025, 0.03])
    felt = FeltObject(BoundingBox(Pose2(), -foot, foot, 0.0, 0.16, {}))
    before = max(
        len(one.touches) for one in StandingPlanner(felt, TIP, WINDOW_rad, SideReach())._grasping._candidates()
    )
    ways = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    low, high = (ways * [*half, 0.0] + [0.0, 0.0, height] for half, height in ((foot, 0.02), (body, 0.06)))
    felt.add(np.vstack([low, high]), np.vstack([ways, ways]))
    after = list(StandingPlanner(felt, TIP, WINDOW_rad, SideReach())._grasping._candidates())
    assert max(len(one.touches) for one in after) > before
    deep = max(after, key=lambda one: one.depth_m)
    assert deep.depth_m > 0.05 - 0.03
    assert is_way_clear(deep.plan, TIP, felt.storeys)


def meet_one(beside: StandingPlanner, *, is_placed: bool) -> bool:
    """The next grasp, of which one finger meets something; whether there was one."""
    if beside.plan() is None or (expected := beside._current) is None:
        return False
    beside.on_grasp(grasp(np.array([expected.touches["TH"]]), ["TH"]))
    beside.on_estimate(is_placed, NOTHING, NOTHING, Pose2())
    return True


def test_an_object_that_is_hardly_met_is_looked_for_with_its_sides_and_given_up_the_fifth_time() -> None:
    beside = planner(box())
    for _ in range(4):
        assert meet_one(beside, is_placed=False)
        assert beside.whereabouts.search() is None
        assert meet_one(beside, is_placed=False)
        search = beside.whereabouts.search()
        assert search is not None
        assert search.reason.startswith("2 grasps in a row met less than half of what was expected")
        assert search.top_m is None
        assert beside.whereabouts.judge(beside.felt.box) is Change.STANDS
        assert beside.whereabouts.search() is None
    assert meet_one(beside, is_placed=False)
    assert meet_one(beside, is_placed=False)
    assert beside.plan() is None
    assert beside.exhausted.startswith("the object does not stay where it is: it was looked for 4 times already")
    assert "mm high" in beside.exhausted


def test_a_grasp_that_meets_nothing_has_the_top_looked_for_where_it_was_and_beside_it_the_way_it_was_pushed() -> None:
    beside = planner(box())
    assert beside.plan() is not None
    beside.on_grasp(grasp(NOTHING, []))
    search = beside.whereabouts.search()
    assert search is not None
    assert "met nothing where" in search.reason
    assert search.top_m == pytest.approx(beside.felt.box.top_m)
    np.testing.assert_allclose(search.places_m[0], beside.felt.top_place_m)
    along_m = np.linalg.norm(search.places_m[1:3] - beside.felt.middle_m, axis=1)
    np.testing.assert_allclose(along_m, [0.35 * 0.187, 0.6 * 0.187])


def test_an_object_whose_top_is_met_each_time_is_not_given_up() -> None:
    beside = planner(box())
    for _ in range(6):
        assert beside.plan() is not None
        beside.on_grasp(grasp(NOTHING, []))
        assert beside.whereabouts.search() is not None
        assert beside.whereabouts.judge(replace(beside.felt.box, has_sides=False)) is Change.STANDS


@pytest.mark.parametrize(
    ("top_m", "aside_m", "change"),
    [(0.187, 0.0, Change.STANDS), (0.187, 0.02, Change.MOVED), (0.06, 0.08, Change.FELL), (0.163, 0.0, Change.FELL)],
)
def test_what_is_found_again_stands_or_was_moved_or_fell(top_m: float, aside_m: float, change: Change) -> None:
    beside = planner(box())
    found = box(top_m=top_m).move(Pose2(aside_m, 0.0, 0.0))
    assert beside.whereabouts.judge(found) is change
    assert str(change) in beside.whereabouts.in_words(change, found, 3)


def test_a_fallen_rod_is_said_to_be_thin() -> None:
    beside = planner(box(width_m=0.010, length_m=0.012))
    beside.whereabouts.searches, beside.whereabouts._reason = 4, "grasp 7 met nothing"
    assert beside.exhausted.endswith("the object is 10 x 12 mm wide and 187 mm high, thinner than a fingertip of 17 mm")


def test_one_grasp_beside_the_object_is_no_fall_nor_are_two_that_fit() -> None:
    beside = planner(box())
    assert all(meet_one(beside, is_placed=is_placed) for is_placed in (False, True, False, True, True))
    assert beside.plan() is not None


def test_a_blocked_way_is_not_tried_again_as_deep() -> None:
    beside = planner(box())
    first = beside.plan()
    beside.on_blocked()
    second = beside.plan()
    assert first is not None
    assert second is not None
    same = (first.closing, first.height_m, first.frame) == (second.closing, second.height_m, second.frame)
    assert not same


def test_what_no_hand_can_span_ends_at_once_with_its_size() -> None:
    beside = planner(box(width_m=0.16, length_m=0.16, turn_rad=0.0))
    assert beside.plan() is None
    assert "160 x 160 mm wide" in beside.exhausted


class NoEstimate:
    """An estimation that knows nothing yet."""

    surface, world_T_object, is_lost, pose_covariance = None, None, False, None


@pytest.mark.parametrize(("top_m", "sideways"), [(0.06, False), (0.187, True)])
def test_the_hand_comes_from_above_or_from_the_side_as_the_object_is_tall(top_m: float, sideways: bool) -> None:
    rule = HeuristicPlanner(PlanSettings(), np.random.default_rng(0), 3)
    chosen = Planner(NoEstimate(), rule, ExplorationSettings(), 2, TIP, 3)  # type: ignore[arg-type]
    chosen.on_bounding_box(box(top_m=top_m))
    plan = chosen.plan(0)
    assert closing(plan.closing, plan.height_m, TIP).is_sideways is sideways
    assert chosen.exhausted == ""


def test_an_object_that_stands_tall_is_never_carried() -> None:
    rule = HeuristicPlanner(PlanSettings(), np.random.default_rng(0), 3)
    chosen = Planner(NoEstimate(), rule, ExplorationSettings(), 2, TIP, 3)  # type: ignore[arg-type]
    chosen.on_bounding_box(box())
    plan = chosen.plan(0)
    assert not chosen.on_grasp(grasp(np.array([[0.04, 0.0, 0.05]]), ["FF"]), plan).moves
