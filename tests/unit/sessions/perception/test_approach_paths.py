"""The fingertips' ways: from the leading point of the open hand to the contact, or to where a finger stopped."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose3, Rot3
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.contacts import FINGERS, Contact
from drivers.shadow.model.kinematics import JOINTS
from sessions.perception.approach_paths import TipSurface, approach_paths
from sessions.recording.session_events import EventKind, SessionEvent
from tests.support.session_fakes import FakeBaseSample, FakeHandSample, FakeTip, make_perception

TIP = TipSurface.upright((0.0085, 0.0085, 0.013), (0.0, 0.0, 0.019))
TIPS = dict.fromkeys(FINGERS, TIP)
OPEN_rad = np.full(len(JOINTS), 0.1)
CLOSED_rad = np.array([0.6 if name[2:] in ("J1", "J2", "J3") else 0.1 for name in JOINTS])


def frames(*shifts_m):
    matrices = np.tile(np.eye(4), (5, 1, 1))
    matrices[:, :3, 3] = shifts_m
    return matrices


def contact(finger, point):
    return Contact(finger, np.array(point), np.array([1.0, 0.0, 0.0]), 1e-6 * np.eye(3), 0.1, 0.5)


def test_a_way_ends_at_the_contact_or_at_the_leading_point():
    touch = contact("MF", [-0.03, 0.002, 0.02])
    found = approach_paths(frames(*np.zeros((5, 3))), frames(*np.tile([-0.02, 0.0, 0.0], (5, 1))), TIPS, [touch])
    assert [line.finger for line in found] == list(FINGERS)
    for line in found:
        np.testing.assert_allclose(line.start_world_m, [-0.0085, 0.0, 0.019], atol=1e-12)
    np.testing.assert_array_equal(found[1].end_world_m, touch.point_world_m)
    np.testing.assert_allclose(found[0].end_world_m, [-0.0285, 0.0, 0.019], atol=1e-12)
    assert [line.touched for line in found] == [False, True, False, False, False]


def test_fingers_that_did_not_move_and_tips_of_unknown_shape_have_no_way():
    ended = frames(*np.tile([-0.02, 0.0, 0.0], (5, 1)))
    ended[2, :3, 3] = [0.0005, 0.0, 0.0]
    tips = {finger: TIP for finger in FINGERS if finger != "TH"}
    assert [line.finger for line in approach_paths(frames(*np.zeros((5, 3))), ended, tips, [])] == ["FF", "MF", "LF"]


angles = st.floats(-3.0, 3.0)


@settings(max_examples=80, deadline=None, derandomize=True)
@given(turn=st.tuples(angles, angles, angles), inner=st.tuples(angles, angles, angles), way=st.tuples(angles, angles))
def test_the_leading_point_is_on_the_ellipsoid_and_no_other_point_is_farther(turn, inner, way):
    tip = TipSurface(np.array([0.006, 0.009, 0.014]), Pose3(Rot3.Ypr(*inner), np.array([0.001, 0.002, 0.019])))
    world_T_distal = Pose3(Rot3.Ypr(*turn), np.array([0.1, 0.2, 0.3])).matrix()
    yaw, pitch = way
    direction = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
    point = tip.leading_point(world_T_distal, direction)
    world_T_tip = world_T_distal @ tip.distal_T_tip.matrix()
    local = world_T_tip[:3, :3].T @ (point - world_T_tip[:3, 3])
    assert np.sum((local / tip.semi_axes_m) ** 2) == pytest.approx(1.0)
    sphere = np.random.default_rng(0).normal(size=(200, 3))
    others = sphere / np.linalg.norm(sphere, axis=1, keepdims=True) * tip.semi_axes_m
    others = others @ world_T_tip[:3, :3].T + world_T_tip[:3, 3]
    assert (others @ direction).max() <= point @ direction + 1e-12


def hear(perception, joints_rad, fingers=()):
    perception.on_hand(FakeHandSample(0, joints_rad))
    perception.on_base(FakeBaseSample(0, np.array([0.05, -0.02, 0.2, 0.4, 0.1, -0.2])))
    for finger in fingers:
        perception.on_wrench(finger, [np.zeros(3)])


def capture(perception, fingers):
    perception.event(SessionEvent(EventKind.CAPTURE_BEGIN, 1))
    hear(perception, CLOSED_rad, fingers)
    return perception.event(SessionEvent(EventKind.CAPTURE_END, 2))


def test_a_grasp_carries_the_ways_of_touching_and_of_missing_fingers():
    perception = make_perception(tip_surfaces=TIPS)
    hear(perception, OPEN_rad)
    perception.event(SessionEvent(EventKind.CLOSE_BEGIN, 0))
    begun = perception.hand.world_T_distal
    grasp = capture(perception, ["FF", "TH"])
    assert {line.finger: line.touched for line in grasp.approach_paths} == {f: f in {"FF", "TH"} for f in FINGERS}
    for line in grasp.approach_paths:
        start = begun[line.finger].transformTo(line.start_world_m) - [0.0, 0.0, 0.019]
        assert np.sum((start / TIP.semi_axes_m) ** 2) == pytest.approx(1.0)
    ends = {line.finger: line.end_world_m for line in grasp.approach_paths}
    for touch in grasp.contacts:
        np.testing.assert_array_equal(ends[touch.finger], touch.point_world_m)


def test_one_closing_belongs_to_one_grasp_and_none_was_told_before_it():
    perception = make_perception(tip_surfaces=TIPS)
    hear(perception, OPEN_rad)
    assert capture(perception, ["FF"]).approach_paths == ()
    hear(perception, OPEN_rad)
    perception.event(SessionEvent(EventKind.CLOSE_BEGIN, 0))
    assert len(capture(perception, ["FF"]).approach_paths) == 5
    assert capture(perception, ["FF"]).approach_paths == ()


class LightlyPressed(FakeTip):
    """Feels that it is pressed, and not where."""

    def contact(self, world_R_distal):
        return None

    def pressed_N(self):
        return 0.3 if self.finger == "MF" else None


def test_a_fingertip_that_is_pressed_and_cannot_tell_where_touches_with_what_went_ahead():
    perception = make_perception(tip=LightlyPressed, tip_surfaces=TIPS)
    hear(perception, OPEN_rad)
    perception.event(SessionEvent(EventKind.CLOSE_BEGIN, 0))
    begun = perception.hand.world_T_distal["MF"]
    (found,) = capture(perception, ["MF"]).contacts
    ended = perception.hand.world_T_distal["MF"]
    ahead = TIP.centre(ended.matrix()) - TIP.centre(begun.matrix())
    ahead /= np.linalg.norm(ahead)
    np.testing.assert_allclose(found.point_world_m, TIP.leading_point(ended.matrix(), ahead), atol=1e-9)
    np.testing.assert_allclose(found.normal_world, -ahead, atol=1e-9)
    assert np.sqrt(ahead @ found.point_covariance_m2 @ ahead) < 0.003
    assert np.sqrt(np.linalg.eigvalsh(found.point_covariance_m2)[-1]) > 0.0039
    assert found.force_N == 0.3
