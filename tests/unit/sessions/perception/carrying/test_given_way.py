"""An object that gives way under a fingertip, or is pushed against it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose2

from drivers.core.contacts import StepSigma
from sessions.perception.carrying.carry import CarryOdometry
from sessions.perception.carrying.given_way import given_way_m, pushed_open_m
from sessions.perception.perception import Perception
from sessions.recording.session_events import EventKind
from tests.support.held_objects import BOX, carried
from tests.support.session_fakes import make_perception
from tests.unit.sessions.perception.test_perception import grasp, hear, tell, touch


@pytest.mark.parametrize(
    ("moved", "expected_m"),
    [
        (Pose2(), 0.0),
        (Pose2(0.0, 0.001, 0.0), 0.0),
        (Pose2(0.0, 0.003, 0.0), 0.003),
        (Pose2(0.0, -0.003, 0.0), 0.003),
        (Pose2(0.003, 0.0, 0.0), 0.0),
        (Pose2(0.0, 0.0, 0.1), 0.003),
    ],
    ids=["at rest", "within the hand's play", "away", "against it", "along its side", "turned"],
)
def test_a_fingertip_tells_how_far_the_object_moved_along_its_normal(moved: Pose2, expected_m: float) -> None:
    steps = carried(BOX, object_motion=moved, palm_motion=Pose2(), felt=("FF",), count=50)
    assert given_way_m(steps) == pytest.approx(expected_m, rel=0.05)


def test_a_fingertip_that_sinks_in_moves_nothing() -> None:
    steps = carried(BOX, object_motion=Pose2(), palm_motion=Pose2(), felt=("FF",), count=50)
    sinking = np.full(steps.sinking.shape, 8.0 / 50)  # units of its give of 0.3 mm: 2.4 mm in all
    moves_m = steps.moves_m - 0.0003 * sinking[..., None] * steps.normals
    assert given_way_m(replace(steps, sinking=sinking, moves_m=moves_m)) == 0.0


@pytest.mark.parametrize(
    ("moved", "force_N", "expected_m"),
    [
        (Pose2(0.0, -0.002, 0.0), 0.5, 0.0018),
        (Pose2(0.0, 0.002, 0.0), 0.5, 0.0),
        (Pose2(0.0, -0.002, 0.0), 0.2, 0.0),
        (Pose2(0.002, 0.0, 0.0), 0.5, 0.0),
    ],
    ids=["into the object", "away from it", "hardly touching", "along its side"],
)
def test_a_fingertip_that_goes_on_into_the_object_while_the_hand_opens_pushes_it(
    moved: Pose2, force_N: float, expected_m: float
) -> None:
    steps = carried(BOX, object_motion=moved, palm_motion=Pose2(), felt=("FF",), count=50)
    opening = replace(steps, forces_N=force_N * steps.felt)
    assert pushed_open_m(opening) == pytest.approx(expected_m, rel=0.1)


def test_fingertips_that_just_let_go_push_nothing() -> None:
    steps = carried(BOX, object_motion=Pose2(0.0, -0.002, 0.0), palm_motion=Pose2(), felt=("FF",), count=50)
    early = np.where(np.cumsum(steps.step_s)[:, None] < 0.12, 0.5 * steps.felt, 0.0)
    assert pushed_open_m(replace(steps, forces_N=early)) == 0.0


def test_what_gave_way_has_moved_and_turned_by_as_much_as_that_allows() -> None:
    odometry, known = CarryOdometry({}, "right"), StepSigma(0.0003, 0.005)
    widened = odometry.closed(known, 0.0, given_way_m=0.003)
    assert widened.translation_m == pytest.approx(np.hypot(0.0003, 0.003))
    assert widened.rotation_rad == pytest.approx(np.hypot(0.005, 0.003 / odometry.friction.half_width_m))


def touched(perception: Perception, stamp_ns: int) -> None:
    """One touch without a grasp."""
    tell(perception, EventKind.CLOSE_BEGIN, stamp_ns)
    hear(perception, stamp_ns=stamp_ns + 1)
    tell(perception, EventKind.CAPTURE_BEGIN, stamp_ns + 2)
    hear(perception, stamp_ns=stamp_ns + 3)
    touch(perception, ("FF",))
    tell(perception, EventKind.TOUCH_END, stamp_ns + 4)


def test_what_was_touched_before_the_object_gave_way_is_dropped_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    perception = make_perception()
    hear(perception)
    touched(perception, 10)
    before = perception.probed
    perception.held.given_way_m = 0.003
    monkeypatch.setattr(perception.held, "on_capture", lambda stamp_ns: None)
    touched(perception, 20)
    assert len(before) == len(perception.probed)
    assert perception.touches.drop_counts["touched before the object gave way"] == len(before)
    perception.held.given_way_m = 0.0
    assert len(grasp(perception, stamp_ns=30).contacts) > len(before)
