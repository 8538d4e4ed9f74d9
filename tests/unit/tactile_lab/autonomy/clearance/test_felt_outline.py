"""What contacts alone tell of where links of the hand would meet the object."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose2, Pose3
from hypothesis import given
from hypothesis import strategies as st

from drivers.core.contacts import Contact, Grasp
from drivers.shadow.closing.posture import HandShape
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from tactile_lab.autonomy.clearance.felt_outline import FeltOutline

LONG_SIDES = ((0.06, -0.02), (0.06, 0.02), (-0.06, 0.02), (-0.06, -0.02))
"""Contacts around a box of 120 x 40 mm, long along x."""
TOP_m = 0.060
ALONG, ACROSS = GraspPlan(GraspFrame(0.0, 0.0, 0.0), "pinch", 0.034), GraspPlan(GraspFrame(0, 0, 1.57), "pinch", 0.034)


def grasp(*places_m: tuple[float, float], pose: Pose2 | None = None, probed: bool = False) -> Grasp:
    placed = np.array([(pose or Pose2()).transformFrom(np.array(place)) for place in places_m])
    contacts = tuple(
        Contact("FF", np.array([*place, 0.034]), np.array([1.0, 0, 0]), 1e-6 * np.eye(3), 0.05, 0.5, probed=probed)
        for place in placed
    )
    return Grasp(0, 0, contacts, Pose3())


def felt(*grasps: Grasp) -> FeltOutline:
    outline = FeltOutline(HandShape())
    for each in grasps:
        outline.on_grasp(each)
    return outline


def test_links_keep_off_what_is_between_the_contacts() -> None:
    outline = felt(grasp(*LONG_SIDES[:2]), grasp(*LONG_SIDES[2:]))
    assert not outline.is_clear(ALONG, TOP_m)
    assert outline.is_clear(ACROSS, TOP_m)
    assert outline.is_clear(replace(ALONG, height_m=0.055), TOP_m)
    assert outline.is_clear(ALONG, 0.030)


@pytest.mark.parametrize(
    "grasps",
    [
        (),
        (grasp(),),
        (grasp(*LONG_SIDES[:2]),),
        (grasp((0.06, 0.0), (0.0, 0.0), (-0.06, 0.0)),),
        (grasp(*LONG_SIDES, probed=True),),
    ],
)
def test_what_encloses_nothing_is_in_no_way(grasps: tuple[Grasp, ...]) -> None:
    assert felt(*grasps).is_clear(ALONG, TOP_m)


@given(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05), st.floats(-0.6, 0.6))
def test_what_was_felt_is_carried_along_with_the_object(x_m: float, y_m: float, turn_rad: float) -> None:
    motion = Pose2(x_m, y_m, turn_rad)
    outline = felt(grasp(*LONG_SIDES[:2]))
    outline.on_carry(motion)
    outline.on_grasp(grasp(*LONG_SIDES[2:], pose=motion))
    for plan, is_clear in ((ALONG, False), (ACROSS, True)):
        carried = GraspFrame(x_m, y_m, plan.frame.yaw_rad + turn_rad)
        assert outline.is_clear(replace(plan, frame=carried), TOP_m) is is_clear


def test_an_object_that_lies_in_another_way_is_felt_anew() -> None:
    outline = felt(grasp(*LONG_SIDES))
    outline.begin_anew()
    assert outline.is_clear(ALONG, TOP_m)
