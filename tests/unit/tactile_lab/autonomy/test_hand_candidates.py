"""Which grasps and touches the hand offers for an object, and which are ruled out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose2

from drivers.shadow.closing.closing import closing
from drivers.shadow.closing.posture import HandShape
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from tactile_lab.autonomy.hand_candidates import (
    LANDED,
    NO_ROOM,
    OUT_OF_REACH,
    TOO_HIGH,
    TOO_TALL,
    grasp_time_s,
    offer,
)
from tactile_lab.autonomy.heuristic_planner import PlanSettings
from tactile_lab.autonomy.policy_choice import PolicyChooser
from tactile_lab.slam.exploration.candidates import ModelledObject, predict_contacts
from tactile_lab.slam.exploration.policy import Belief
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tests.support.box_shapes import FLAT_BOX, SOLID_BOX, HEIGHT_m, flat_box
from tests.support.hand_limits import chooser, knowledge, limits
from tests.support.rectangle_world import modelled

YAWS, SHIFTS, CLOSINGS, HEIGHTS, LEANING_HEIGHTS = 12, 7, 2, 3, 2
IN_PLANE = YAWS * SHIFTS * CLOSINGS


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


@pytest.mark.parametrize(("half_length_m", "ends"), [(0.050, set()), (0.070, {-1.0, 1.0})])
def test_a_long_object_is_tapped_near_its_ends_too(half_length_m: float, ends: set[float]) -> None:
    assert SOLID_BOX.surface is not None
    stretched_m = SOLID_BOX.surface.points_m * [half_length_m / 0.05, 1.0, 1.0]
    long = replace(SOLID_BOX, surface=replace(SOLID_BOX.surface, points_m=stretched_m))
    across = limits(3, plan=PlanSettings(yaw_window_rad=(1.50, 1.57)))  # the hand's fingers side by side along it
    taps = [one.plan for one in offer(across, long, Pose2()).usable if one.plan.tap]
    aside_m = np.array([plan.frame.x_m - long.centre_m[0] for plan in taps])
    assert np.abs(aside_m).min() < 0.001
    assert {float(np.sign(place)) for place in aside_m if abs(place) > 0.03} == ends
