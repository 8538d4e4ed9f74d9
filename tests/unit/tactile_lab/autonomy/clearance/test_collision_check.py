"""Links above the fingertips and an object: distances to it, and the grasps that keep them off it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose2
from hypothesis import given
from hypothesis import strategies as st

from drivers.shadow.closing.posture import HandShape
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from tactile_lab.autonomy.clearance.collision_check import StandingObject, links_are_clear, standing
from tests.support.box_shapes import FLAT_BOX, SOLID_BOX, flat_box, solid_box

TIP = HandShape()
CENTRE = GraspFrame(0.0, 0.0, 0.0)


def flat(top_m: float, pose: Pose2 | None = None) -> StandingObject:
    target = standing(FLAT_BOX, pose or Pose2(), top_m)
    assert target is not None
    return target


def solid(height_m: float, half_x_m: float = 0.03) -> StandingObject:
    target = standing(solid_box(height_m, half_x_m, 0.03), Pose2(), 0.0)
    assert target is not None
    return target


def verdict(plan: GraspPlan, target: StandingObject) -> bool:
    return bool(links_are_clear([plan], TIP, target)[0])


@pytest.mark.parametrize(
    ("place_mm", "distance_mm"),
    [
        ((70, 0, 10), 20),  # beside it
        ((0, 0, 75), 15),  # above
        ((70, 0, 75), 25),  # beyond the edge of its top
        ((0, 20, 30), -10),  # inside, behind a side
        ((0, 0, 55), -5),  # inside, below the top
    ],
)
def test_distances_to_a_contour_that_stands_upright(place_mm: tuple[int, int, int], distance_mm: float) -> None:
    found_m = flat(0.060).distances_m(np.array(place_mm) * 1e-3)
    assert 1e3 * float(found_m) == pytest.approx(distance_mm, abs=2.0)


@pytest.mark.parametrize(("place_mm", "distance_mm"), [((70, 0, 20), 20), ((0, 0, 55), 15), ((0, 0, 32), -8)])
def test_distances_to_a_solid(place_mm: tuple[int, int, int], distance_mm: float) -> None:
    target = standing(SOLID_BOX, Pose2(), 0.0)
    assert target is not None
    assert 1e3 * float(target.distances_m(np.array(place_mm) * 1e-3)) == pytest.approx(distance_mm, abs=3.0)


@given(x=st.floats(-0.2, 0.2), y=st.floats(-0.2, 0.2), turn=st.floats(-3.1, 3.1))
def test_distances_go_with_the_object(x: float, y: float, turn: float) -> None:
    places_m = np.array([[0.07, 0.01, 0.03], [0.0, 0.05, 0.01], [-0.02, -0.01, 0.08]])
    pose = Pose2(x, y, turn)
    moved_m = np.array([[*pose.transformFrom(place[:2]), place[2]] for place in places_m])
    assert flat(0.06, pose).distances_m(moved_m) == pytest.approx(flat(0.06).distances_m(places_m), abs=1e-9)


def test_nothing_is_told_of_an_object_that_is_not_enclosed_yet() -> None:
    assert standing(replace(FLAT_BOX, surface=None), Pose2(), 0.06) is None


def test_a_low_grasp_is_clear_of_what_is_low_and_not_of_what_is_tall() -> None:
    """The knuckles of a hand whose fingertips are at 18 mm are at 62 mm, and the thumb's hub at 51 mm."""
    plan = GraspPlan(CENTRE, "radial", 0.018)
    assert verdict(plan, solid(0.035))
    assert not verdict(plan, solid(0.060))


def test_a_hand_that_stands_higher_is_clear_of_what_is_tall() -> None:
    assert verdict(GraspPlan(CENTRE, "radial", 0.048), solid(0.060))


def test_a_finger_that_reaches_down_over_an_edge_is_not_clear() -> None:
    """Its open tip is beyond the end of the box, its middle link over it."""
    long_box = solid(0.040, 0.060)
    assert verdict(GraspPlan(CENTRE, "pinch", 0.034), solid(0.040))
    assert not verdict(GraspPlan(CENTRE, "pinch", 0.018), long_box)


def test_plans_of_all_kinds_are_judged_each_for_itself() -> None:
    plans = [
        GraspPlan(replace(CENTRE, yaw_rad=yaw), name, height_m)
        for yaw in (-1.0, 0.0, 0.7)
        for name, height_m in (("radial", 0.018), ("pinch", 0.034), ("radial", 0.048))
    ]
    target = solid(0.060)
    together = links_are_clear(plans, TIP, target)
    assert together.tolist() == [verdict(plan, target) for plan in plans]
    assert together.any()
    assert not together.all()
    assert links_are_clear([], TIP, target).shape == (0,)


def test_a_contour_is_as_tall_as_it_is_taken_to_be() -> None:
    target, plan = flat_box(0.03, 0.03), GraspPlan(CENTRE, "radial", 0.034)
    low, tall = (standing(target, Pose2(), top_m) for top_m in (0.040, 0.090))
    assert low is not None
    assert tall is not None
    assert verdict(plan, low)
    assert not verdict(plan, tall)
