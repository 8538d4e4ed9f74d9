"""Touches of an object that stays where it stands: new each time, never so high that it tips, and an end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from gtsam import Pose2, Pose3

from drivers.core.contacts import ApproachPath, Contact, Grasp
from drivers.shadow.closing.closing import closing
from drivers.shadow.closing.posture import HandShape
from drivers.shadow.model.hand_form import HandForm
from drivers.shadow.model.motors import DRIVEN_JOINTS
from sessions.motion.cycle_settings import TouchSettings
from sessions.motion.probing.bounding_box import BoundingBox
from sessions.motion.probing.touch_patterns import TAP, TAP_HEIGHT_m
from sessions.motion.safety import SafetySettings
from tactile_lab.autonomy.standing.candidate import SideReach, StandingCandidate, approach_of
from tactile_lab.autonomy.standing.felt_object import FeltObject
from tactile_lab.autonomy.standing.planner import StandingPlanner, Standstill
from tactile_lab.autonomy.standing.side_clearance import StandingBox
from tactile_lab.autonomy.standing.touch_planner import TouchPlanner

TIP = HandShape()
LEFT = HandForm("left", DRIVEN_JOINTS)
LITE = HandForm("right", tuple(name for name in DRIVEN_JOINTS if name[:2] not in ("LF", "WR")))
"""Three fingers and a thumb, on an arm in place of a wrist."""
WINDOW_rad = (-1.31, 1.31)
PINCH = "a pinch over the rim, the thumb inside"


def felt(length_m: float = 0.21, width_m: float = 0.16, top_m: float = 0.07) -> FeltObject:
    high = np.array([length_m, width_m]) / 2
    return FeltObject(BoundingBox(Pose2(0.01, 0.0, 0.2), -high, high, 0.008, top_m, {}))


def planner(known: FeltObject) -> TouchPlanner:
    return TouchPlanner(known, TIP, WINDOW_rad, SideReach())


def contacts(points_m: np.ndarray, normal: tuple[float, float, float]) -> Grasp:
    made = [Contact("FF", point, np.array(normal), 1e-6 * np.eye(3), 0.1, 0.4, probed=True) for point in points_m]
    return Grasp(0, 0, tuple(made), Pose3(), Pose3())


def carry_out(touches: TouchPlanner, most: int = 80) -> list[StandingCandidate]:
    """All touches until there is none, each of which meets what it expects."""
    done = []
    while (best := touches.best()) is not None and len(done) < most:
        touches.felt.on_looked(best.touches_m, on_top=best.on_top)
        done.append(best)
    return done


@dataclass(frozen=True)
class Touched:
    """A box, and all touches of it."""

    known: FeltObject
    done: list[StandingCandidate]


@pytest.fixture(scope="module")
def wide() -> Touched:
    known = felt()
    return Touched(known, carry_out(planner(known)))


def test_a_wide_box_is_tapped_all_over_and_touched_all_around_until_nothing_is_new(wide: Touched) -> None:
    known, done = wide.known, wide.done
    assert 10 < len(done) < 80
    assert all(one.plan.only_touch for one in done)
    on_top = np.array([place for one in done for place in one.touches_m if place[2] == 0.07])
    inside = np.array([known.box.world_T_box.transformTo(place[:2]) for place in on_top])
    assert np.ptp(inside[:, 0]) > 0.15
    assert np.ptp(inside[:, 1]) > 0.10
    aside = {one.plan.closing for one in done if closing(one.plan.closing, one.plan.height_m, TIP).is_sideways}
    assert aside == {"pinch-from-left", "pinch-from-right"}


@pytest.mark.parametrize("hand", [TIP, HandShape(form=LEFT), HandShape(form=LITE)], ids=["right", "left", "lite"])
def test_the_palm_of_every_hand_stays_above_the_table_and_fingers_it_lacks_touch_nothing(hand: HandShape) -> None:
    done = carry_out(TouchPlanner(felt(0.12, 0.10, 0.12), hand, WINDOW_rad, SideReach()))
    aside = [one for one in done if closing(one.plan.closing, one.plan.height_m, hand).is_sideways]
    palms_m = [closing(one.plan.closing, one.plan.height_m, hand).grasp_T_palm.z() for one in aside]
    assert min(palms_m) > SafetySettings().palm_minimum_height_m + 0.004
    assert all(set(one.touches) <= set(hand.form.fingers) for one in done)


def test_every_expected_place_lies_on_the_box(wide: Touched) -> None:
    places = np.vstack([one.touches_m for one in wide.done])
    assert np.abs(wide.known.standing_box.distances_m(places)).max() < 1e-6


def test_a_narrow_tall_object_is_touched_low_only() -> None:
    done = carry_out(planner(felt(0.04, 0.04, 0.20)))
    sides = [one for one in done if closing(one.plan.closing, one.plan.height_m, TIP).is_sideways]
    assert sides
    assert max(place[2] for one in sides for place in one.touches_m) < 0.04 + 1e-9


def from_the_side(done: list[StandingCandidate], hand: HandShape = TIP) -> list[StandingCandidate]:
    return [one for one in done if closing(one.plan.closing, one.plan.height_m, hand).is_sideways]


def sides(known: FeltObject, hand: HandShape = TIP) -> list[StandingCandidate]:
    """All touches from the side, one after another."""
    return from_the_side(carry_out(TouchPlanner(known, hand, WINDOW_rad, SideReach())), hand)


def test_one_coming_touches_a_side_at_several_places_that_are_all_new(wide: Touched) -> None:
    first = from_the_side(wide.done)[0]
    assert len(first.plan.places) == 3
    assert first.plan.places[0].frame == first.plan.frame
    assert len({place.frame.yaw_rad for place in first.plan.places}) == 1
    apart_m = np.linalg.norm(first.touches_m[:, None] - first.touches_m[None], axis=-1)
    assert apart_m[apart_m > 0].min() > 0.015
    assert len(first.touches_m) == sum(3 if place.height_m < 0.02 else 2 for place in first.plan.places)


def test_the_middle_of_a_wide_tall_side_is_touched_high_up_where_no_closing_gets_and_the_box_hardly_leans() -> None:
    known = felt(0.16, 0.06, 0.21)
    places = [place for one in sides(known) for place in one.plan.places]
    own = np.array(
        [known.box.world_T_box.transformTo(np.array([place.frame.x_m, place.frame.y_m])) for place in places]
    )
    heights_m = np.array([place.height_m for place in places])
    on_broad = np.abs(np.abs(own[:, 1]) - 0.03) < 1e-6
    high = on_broad & (heights_m > 0.06)
    assert np.count_nonzero(high) > 6
    assert np.abs(own[high, 0]).max() < 0.03
    assert heights_m[high].min() > TouchSettings().past_side_m * 0.21 / 0.03
    assert 0.12 < heights_m[high].max() < 0.8 * 0.21


def test_fingers_are_laid_on_together_as_high_as_a_wide_object_slides() -> None:
    low, tall = sides(felt(0.09, 0.09, 0.16)), sides(felt(0.04, 0.04, 0.16))
    assert {len(one.touches) for one in low} == {3, 4}
    assert {len(one.touches) for one in tall} <= {1}


def test_no_finger_of_a_tap_comes_down_on_an_edge() -> None:
    known = felt(0.09, 0.08)
    box, taps = known.storeys.boxes[-1], list(planner(known)._taps())
    table = closing(TAP.closing, TAP_HEIGHT_m, TIP)
    assert {round(one.plan.frame.yaw_rad, 2) for one in taps} != {0.0}
    for one in taps:
        tips_m = [table.path(finger).centre_m(TAP.progress[finger]) for finger in table.fingers]
        places_m = np.array([one.plan.frame.pose.transformFrom(tip_m)[:2] for tip_m in tips_m])
        outside_m = box.outside_m(places_m)
        assert np.all((outside_m < -0.004) | (outside_m > TIP.radius_m + 0.004))


def test_what_is_round_ends_before_its_box_does() -> None:
    box = StandingBox(0.1, -0.2, 0.3, (0.08, 0.08, 0.05))
    corner_m = box.centre_m + 0.05 * np.array([[np.cos(0.3 + np.pi / 4), np.sin(0.3 + np.pi / 4)]])
    assert box.outside_m(corner_m)[0] < 0.0
    assert box.outside_circle_m(corner_m)[0] == pytest.approx(0.01)


def test_where_a_tap_met_nothing_the_top_is_open_and_no_fingertip_is_expected_there() -> None:
    known = felt(0.16, 0.16, 0.05)
    met, missed = np.array([[0.06, 0.0, 0.05]]), np.array([[0.01, 0.0, 0.05]])
    known.add(met, np.array([[0.0, 0.0, 1.0]]))
    known.on_missed_top(np.vstack([met + 0.005, missed]))
    open_ = known.are_open(np.array([[x_m, 0.0, 0.05] for x_m in (0.02, 0.045, 0.06, -0.03)]))
    assert open_.tolist() == [True, False, False, False]
    on_top = [one for one in planner(known)._taps() if one.touches]
    apart_m = np.linalg.norm(np.vstack([one.touches_m for one in on_top]) - missed, axis=1)
    assert on_top
    assert apart_m.min() > 0.020


def test_what_is_slender_is_touched_as_low_as_can_be_by_one_finger_and_not_twice_from_the_same_side() -> None:
    known = felt(0.098, 0.045, 0.177)
    broad = np.array([np.cos(0.2 + np.pi / 2), np.sin(0.2 + np.pi / 2)])
    assert known.is_slender(broad)
    assert not known.is_slender(np.array([np.cos(0.2), np.sin(0.2)]))
    low = [one for one in sides(known) if abs(broad @ approach_of(one.plan, TIP)) > 0.9]
    assert {len(one.touches) for one in low} == {1}
    assert {place.height_m for one in low for place in one.plan.places} <= {0.020, 0.032}
    known.on_pushed(broad)
    assert not known.may_be_pushed(broad)
    assert known.may_be_pushed(-broad)
    assert all(broad @ approach_of(one.plan, TIP) < 0.1 for one in sides(known))


def test_what_closings_reach_from_both_ends_is_not_touched_high_up_however_askew_the_hand_comes() -> None:
    high = np.array([0.097, 0.046]) / 2
    known = FeltObject(BoundingBox(Pose2(0.0, 0.0, np.radians(80.0)), -high, high, 0.008, 0.177, {}))
    broad = [one for one in sides(known) if known.is_slender(approach_of(one.plan, TIP))]
    assert any(one.plan.frame.yaw_rad == WINDOW_rad[1] for one in broad), "no hand comes askew"
    assert {place.height_m for one in broad for place in one.plan.places} <= {0.020, 0.032}


def passed(ends_m: np.ndarray, touched: bool = False) -> list[ApproachPath]:
    return [ApproachPath("FF", end_m, end_m, touched) for end_m in ends_m]


def test_a_side_is_expected_behind_where_fingertips_passed_and_nowhere_once_they_passed_the_middle() -> None:
    known, way = felt(0.12, 0.12, 0.06), np.array([np.cos(0.2), np.sin(0.2)])
    front_m = np.array([*(known.middle_m - 0.06 * way), 0.02])

    def beyond_m(ahead_m: float, up_m: float) -> np.ndarray:
        return front_m[None] + np.array([*(ahead_m * way), up_m])

    assert known.passed_m(front_m, way) == 0.0
    known.on_passed(passed(beyond_m(0.012, 0.003)))
    known.on_passed(passed(beyond_m(0.030, 0.0), touched=True))
    known.on_passed(passed(beyond_m(0.030, 0.02)))
    assert known.passed_m(front_m, way) == pytest.approx(0.012)
    assert known.passed_m(front_m, -way) == 0.0
    box, touches = known.standing_box, planner(known)
    np.testing.assert_allclose(touches._front_m(box, known.middle_m, way, 0.02), (front_m[:2] + 0.012 * way))
    known.on_passed(passed(beyond_m(0.061, 0.0)))
    assert touches._front_m(box, known.middle_m, way, 0.02) is None


def test_where_contacts_were_expected_none_is_expected_again_wherever_they_were_found() -> None:
    standing = StandingPlanner(felt(0.07, 0.07, 0.10), TIP, WINDOW_rad, SideReach())
    plan = standing.plan()
    assert plan is not None
    assert not plan.only_touch
    current = standing._current
    assert current is not None
    standing.on_grasp(contacts(current.touches_m + np.array([0.0, 0.0, 0.02]), (0, 0, 1)))
    assert standing.felt.distances_m(current.touches_m).max() == 0.0


def test_a_blocked_touch_is_not_tried_again() -> None:
    touches = planner(felt())
    first = touches.best()
    assert first is not None
    touches.blocked.append(first)
    second = touches.best()
    assert second is not None
    assert (first.plan.closing, first.plan.frame) != (second.plan.closing, second.plan.frame)


def test_what_cannot_be_grasped_is_touched_and_then_ends_in_words() -> None:
    standing = StandingPlanner(felt(), TIP, WINDOW_rad, SideReach(), TouchSettings())
    plan = standing.plan()
    assert plan is not None
    assert plan.only_touch
    assert "contacts expected" in plan.reason
    standing.on_blocked()
    reasons = []
    while (plan := standing.plan()) is not None and standing.felt.grasps < 80:
        reasons.append(plan.reason)
        if plan.only_touch or len([one for one in reasons if one == PINCH]) > 1:
            standing.on_grasp(contacts(np.empty((0, 3)), (0, 0, 1)))
        else:
            standing.on_blocked()
    assert plan is None
    assert PINCH in reasons
    assert standing.exhausted.startswith("nothing left that the hand can reach: 0 grasps, ")
    assert "touches, 2 approaches were blocked; the object is 160 x 210 mm wide and 70 mm high" in standing.exhausted


def test_places_whose_contacts_were_elsewhere_are_looked_for_two_times_more_before_nothing_is_left() -> None:
    standing = StandingPlanner(felt(0.16, 0.16, 0.05), TIP, WINDOW_rad, SideReach(), TouchSettings())
    tried: list[tuple[str, float, float]] = []
    while (plan := standing.plan()) is not None and len(tried) < 200:
        tried.append((plan.closing, plan.frame.yaw_rad, plan.height_m))
        standing.on_grasp(contacts(np.empty((0, 3)), (0, 0, 1)))
    assert plan is None
    assert tried.count(tried[0]) >= 3


def test_an_object_grows_with_what_is_felt() -> None:
    known = FeltObject.around(np.array([0.1, 0.0]), 0.05, np.empty((0, 3)), np.empty((0, 3)))
    np.testing.assert_allclose(known.middle_m, [0.1, 0.0])
    known.on_grasp(contacts(np.array([[0.18, 0.0, 0.06]]), (0.0, 0.0, 1.0)))
    np.testing.assert_allclose(known.standing_box.size_m, [0.11, 0.06, 0.06])
    sides = np.array([[0.18, y, 0.02] for y in (-0.03, 0.03)] + [[0.04, y, 0.02] for y in (-0.03, 0.03)])
    normals = np.array([[1.0, 0, 0], [1, 0, 0], [-1, 0, 0], [-1, 0, 0]])
    known.add(sides, normals)
    np.testing.assert_allclose(known.middle_m, [0.11, 0.0], atol=1e-9)


@pytest.mark.parametrize(
    ("shares", "reached"),
    [((0.3, 0.5, 0.6, 0.7), False), ((0.5, 0.5, 0.5), False), ((0.5, 0.505, 0.508, 0.502), True), ((0.5,) * 5, True)],
)
def test_a_standstill_is_three_grasps_that_add_nothing(shares: tuple[float, ...], reached: bool) -> None:
    watch = Standstill()
    for share in shares:
        watch.note(share)
    assert watch.is_reached is reached


def test_an_object_reaches_as_far_as_fingertips_have_landed_on_it() -> None:
    known = FeltObject.around(np.zeros(2), 0.06, np.empty((0, 3)), np.empty((0, 3)))
    assert not known.is_wide
    known.on_landings([np.array([0.05, -0.045, 0.07]), np.array([-0.05, 0.05, 0.07])])
    np.testing.assert_allclose(known.standing_box.size_m, [0.10, 0.095, 0.06])
    assert known.is_wide


def test_one_finger_comes_down_on_a_small_top_that_nothing_has_felt_and_only_once() -> None:
    known = felt(0.03, 0.03, 0.13)
    touches = planner(known)
    assert not list(touches._taps())
    best = touches.best()
    assert best is not None
    assert best.plan.down_to_m == pytest.approx(0.10)
    np.testing.assert_allclose(best.touches_m, [[*known.middle_m, 0.13]])
    known.on_looked(best.touches_m, on_top=True)
    assert not list(touches._one_finger())


def test_a_top_that_was_felt_is_touched_by_no_finger_alone() -> None:
    known = felt(0.03, 0.03, 0.13)
    known.on_grasp(contacts(np.array([[0.01, 0.004, 0.129]]), (0.1, 0.0, 0.99)))
    assert known.is_top_felt
    assert not list(planner(known)._one_finger())
