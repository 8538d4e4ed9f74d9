from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose3, Rot3

from drivers.core.contacts import FINGERS
from drivers.core.errors import DeviceError, SessionError
from drivers.core.fingertip import TipContact
from drivers.shadow.model.kinematics import JOINTS, forearm_T_palm, palm_T_distal, palm_T_distal_matrices
from drivers.simulation.calibration import SimulatedCalibration
from sessions.perception.carrying.carry_noise import CarryNoise
from sessions.perception.contact_world import HandGeometry, MountUncertainty
from sessions.perception.event_outcomes import TareReport, TruthFrame
from sessions.perception.perception import PerceptionSettings
from sessions.recording.session_events import EventKind, SessionEvent
from tests.support.session_fakes import (
    FakeBaseSample,
    FakeFrame,
    FakeHandSample,
    FakeTip,
    make_perception,
    mount_T_forearm,
)

BEND_rad = np.array([0.4 if name[2:] in ("J1", "J2", "J3") else 0.1 for name in JOINTS])
BASE_q = np.array([0.05, -0.02, 0.2, 0.4, 0.1, -0.2])
TIP = TipContact(
    np.array([0.002, -0.007, 0.02]), np.array([0.0, 1.0, 0.0]), np.diag([1e-8, 4e-8, 2e-8]), 0.05, 0.7, 0.0
)


def hear(perception, joints_rad=BEND_rad, base_q=BASE_q, stamp_ns=0):
    perception.on_hand(FakeHandSample(stamp_ns, np.asarray(joints_rad)))
    perception.on_base(FakeBaseSample(stamp_ns, np.asarray(base_q)))


def touch(perception, fingers=FINGERS):
    for finger in fingers:
        perception.on_wrench(finger, [np.zeros(3)])


def tell(perception, kind, stamp_ns=0, **options):
    return perception.event(SessionEvent(kind, stamp_ns, **options))


def grasp(perception, fingers=FINGERS, stamp_ns=0):
    tell(perception, EventKind.CAPTURE_BEGIN, stamp_ns)
    hear(perception)
    touch(perception, fingers)
    return tell(perception, EventKind.CAPTURE_END, stamp_ns + 100)


def expected_palm(perception, joints_rad=BEND_rad, base_q=BASE_q):
    return perception.world_T_mount * mount_T_forearm(base_q) * forearm_T_palm(joints_rad)


def test_frames_follow_mount_positioner_wrist_and_fingers():
    perception = make_perception()
    hear(perception)
    assert perception.hand.world_T_palm.equals(expected_palm(perception), 1e-12)
    for finger, palm_T_tip in palm_T_distal(BEND_rad).items():
        world_T_distal = expected_palm(perception) * palm_T_tip
        assert perception.hand.world_T_distal[finger].equals(world_T_distal, 1e-12)
        np.testing.assert_allclose(
            perception.hand.world_R_distal[finger], world_T_distal.rotation().matrix(), atol=1e-12
        )


def test_a_contact_is_placed_in_the_world_through_its_finger():
    perception = make_perception()
    hear(perception)
    result = grasp(perception, stamp_ns=1000)
    assert [contact.finger for contact in result.contacts] == list(FINGERS)
    assert result.stamp_ns == 1050
    for contact in result.contacts:
        world_T_distal = perception.hand.world_T_distal[contact.finger]
        shift = 1e-3 * 1e-3 * world_T_distal.rotation().matrix()[2]
        expected = world_T_distal.transformFrom(np.array([0.0, -0.007, 0.02]) + shift)
        np.testing.assert_allclose(contact.point_world_m, expected, atol=1e-12)
        np.testing.assert_allclose(contact.normal_world, world_T_distal.rotation().matrix()[:, 1], atol=1e-12)


def test_the_capture_averages_joint_angles():
    perception = make_perception()
    hear(perception, BEND_rad + 0.3)
    tell(perception, EventKind.CAPTURE_BEGIN)
    for offset in (-0.02, 0.0, 0.02):
        hear(perception, BEND_rad + offset, BASE_q + offset)
    result = tell(perception, EventKind.CAPTURE_END)
    assert result.world_T_palm.equals(expected_palm(perception), 1e-12)


def test_samples_that_are_not_fresh_are_left_out():
    perception = make_perception()
    hear(perception)
    tell(perception, EventKind.CAPTURE_BEGIN)
    hear(perception)
    perception.on_hand(FakeHandSample(5, BEND_rad + 1.0, fresh=False))
    assert tell(perception, EventKind.CAPTURE_END).world_T_palm.equals(expected_palm(perception), 1e-12)
    assert perception.hand_stamp_ns == 0


def test_point_covariance_contains_the_joint_angles_through_the_jacobian():
    sigma = float(np.radians(0.6))
    geometry = HandGeometry(BEND_rad, expected_palm(make_perception()).matrix())
    contacts = geometry.contacts(dict.fromkeys(FINGERS, TIP), sigma, None)
    random = np.random.default_rng(3)
    finger_joints = np.array([not name.startswith("WR") for name in JOINTS])
    joints = BEND_rad + sigma * random.standard_normal((20_000, 24)) * finger_joints
    frames = geometry.world_T_palm @ palm_T_distal_matrices(joints)
    points = frames[..., :3, :3] @ TIP.point_distal_m + frames[..., :3, 3]
    normals = frames[..., :3, :3] @ TIP.normal_distal
    for index, contact in enumerate(contacts):
        rotation = geometry.world_T_distal[index, :3, :3]
        expected = np.cov(points[:, index].T) + rotation @ TIP.point_covariance_m2 @ rotation.T
        np.testing.assert_allclose(contact.point_covariance_m2, expected, atol=0.05 * np.trace(expected))
        shared = np.cov(points[:, index].T)  # offsets of the joints: the same for all contacts of the finger
        moves = contact.shared_moves_m
        assert moves is not None
        assert moves.shape == (3, 5)
        np.testing.assert_allclose(moves @ moves.T, shared, atol=0.05 * np.trace(shared))
        tilt = np.trace(np.cov(normals[:, index].T)) / 2
        assert contact.normal_sigma_rad == pytest.approx(np.sqrt(TIP.normal_sigma_rad**2 + tilt), rel=0.05)


def test_point_covariance_contains_the_mounting():
    world_T_mount = Pose3(Rot3.Ypr(0.3, 0.1, -0.2), np.array([0.4, 0.1, 0.3]))
    sigmas = np.array([0.004, 0.002, 0.006, 0.001, 0.002, 0.0005])
    mount = MountUncertainty(world_T_mount.matrix(), np.diag(sigmas**2))
    point = np.array([0.05, -0.03, 0.04])
    fixed = world_T_mount.transformTo(point)
    random = np.random.default_rng(4)
    moved = [
        world_T_mount.compose(Pose3.Expmap(sigmas * random.standard_normal(6))).transformFrom(fixed)
        for _ in range(4000)
    ]
    covariance, turn = mount.at(point)
    expected = np.cov(np.array(moved).T)
    np.testing.assert_allclose(covariance, expected, atol=0.06 * np.trace(expected))
    assert np.trace(turn) == pytest.approx(np.sum(sigmas[:3] ** 2))


def test_the_mounting_widens_contacts_when_its_covariance_is_given():
    plain, widened = make_perception(), make_perception(mount_covariance=1e-6 * np.eye(6))
    for perception in (plain, widened):
        hear(perception)
    pairs = zip(grasp(plain).contacts, grasp(widened).contacts, strict=True)
    assert all(np.trace(b.point_covariance_m2) > np.trace(a.point_covariance_m2) + 2e-6 for a, b in pairs)


def test_covariances_are_symmetric_and_positive():
    perception = make_perception()
    hear(perception)
    for contact in grasp(perception).contacts:
        covariance = contact.point_covariance_m2
        np.testing.assert_array_equal(covariance, covariance.T)
        assert np.linalg.eigvalsh(covariance).min() > 0


def test_dropped_fingers_are_counted_with_their_reason():
    perception = make_perception()
    hear(perception)
    result = grasp(perception, fingers=("FF", "MF", "TH"))
    assert [contact.finger for contact in result.contacts] == ["FF", "MF", "TH"]
    assert perception.touches.dropped == {"RF": "no contact", "LF": "no contact"}
    grasp(perception)
    assert perception.touches.dropped == {}
    assert perception.touches.drop_counts == {"no contact": 2}


def test_a_touch_below_the_minimum_force_is_no_contact():
    perception = make_perception(force_N=0.05, settings=PerceptionSettings(minimum_force_N=0.1))
    hear(perception)
    assert grasp(perception).contacts == ()
    assert perception.touches.drop_counts == {"force below the minimum": 5}


def test_without_joint_angles_in_the_capture_there_are_no_contacts():
    perception = make_perception()
    hear(perception)
    tell(perception, EventKind.CAPTURE_BEGIN)
    touch(perception)
    assert tell(perception, EventKind.CAPTURE_END).contacts == ()
    assert set(perception.touches.dropped.values()) == {"no joint angles during the capture"}


def test_hand_motion_composes_all_holds_since_the_last_grasp():
    perception = make_perception()
    hear(perception)
    assert grasp(perception).hand_motion_world.equals(Pose3(), 0.0)
    stops = [BASE_q + np.array([0.02, 0.0, 0.0, 0.3, 0.0, 0.0]), BASE_q + 0.1, BASE_q - 0.05, BASE_q]
    moves = []
    for begin, end in zip(stops[::2], stops[1::2], strict=True):
        hear(perception, base_q=begin)
        tell(perception, EventKind.HOLD_BEGIN)
        hear(perception, base_q=end)
        tell(perception, EventKind.HOLD_END)
        moves.append(expected_palm(perception, base_q=end) * expected_palm(perception, base_q=begin).inverse())
    assert grasp(perception).hand_motion_world.equals(moves[1] * moves[0], 1e-12)
    assert grasp(perception).hand_motion_world.equals(Pose3(), 0.0)


def test_a_grasp_inside_a_hold_counts_the_motion_so_far_and_the_hold_goes_on():
    perception = make_perception()
    hear(perception)
    grasp(perception)
    hear(perception, base_q=BASE_q + 0.2)
    tell(perception, EventKind.HOLD_BEGIN)
    first = grasp(perception).hand_motion_world
    assert first.equals(expected_palm(perception) * expected_palm(perception, base_q=BASE_q + 0.2).inverse(), 1e-12)
    hear(perception, base_q=BASE_q - 0.1)
    tell(perception, EventKind.HOLD_END)
    second = expected_palm(perception, base_q=BASE_q - 0.1) * expected_palm(perception).inverse()
    assert grasp(perception).hand_motion_world.equals(second, 1e-12)


def test_a_truth_frame_belongs_to_the_grasp_being_captured_or_just_made():
    perception = make_perception()
    hear(perception)
    frames = [FakeFrame(number, b"") for number in range(3)]
    perception.on_frame(frames[0])
    assert tell(perception, EventKind.TRUTH_FRAME) == TruthFrame(None, frames[0])
    assert tell(perception, EventKind.TRUTH_FRAME) is None
    tell(perception, EventKind.CAPTURE_BEGIN)
    perception.on_frame(frames[1])
    assert tell(perception, EventKind.TRUTH_FRAME) == TruthFrame(0, frames[1])
    tell(perception, EventKind.CAPTURE_END)
    perception.on_frame(frames[2])
    assert tell(perception, EventKind.TRUTH_FRAME) == TruthFrame(0, frames[2])


def test_a_tare_reaches_the_named_fingers_and_reports_refusals():
    perception = make_perception()
    hear(perception)
    touch(perception, ["FF"])
    assert perception.loads_N()["FF"] > 0
    report = tell(perception, EventKind.TARE, fingers=("FF", "TH"))
    assert isinstance(report, TareReport)
    assert set(report.refused) == {"TH"}
    assert perception.loads_N()["FF"] == pytest.approx(0.0, abs=1e-12)


def test_loads_are_known_for_every_fingertip():
    perception = make_perception()
    hear(perception)
    assert perception.loads_N() == dict.fromkeys(FINGERS, 0.0)
    perception.on_wrench("RF", [np.array([3.0, 0.0, 4.0])])
    assert perception.loads_N()["RF"] == pytest.approx(5.0, abs=0.011)
    assert perception.void_tips() == {}


def test_a_fingertip_that_tells_no_force_says_why():
    perception = make_perception()
    hear(perception)
    perception.fingertips["RF"].fault = "saturated"
    perception.on_wrench("RF", [np.full(3, np.inf)])
    assert perception.void_tips() == {"RF": "saturated"}


def test_problems_name_the_finger():
    perception = make_perception()
    perception.fingertips["MF"].fault = "saturated"
    assert perception.problems() == ("MF: saturated",)


@pytest.mark.parametrize("kind", [EventKind.CAPTURE_END, EventKind.HOLD_END])
def test_an_end_without_a_beginning_is_refused(kind):
    perception = make_perception()
    hear(perception)
    with pytest.raises(SessionError, match="without"):
        tell(perception, kind)


@pytest.mark.parametrize("kind", [EventKind.CAPTURE_BEGIN, EventKind.HOLD_BEGIN, EventKind.TARE])
def test_marks_before_the_first_samples_name_the_silent_device(kind):
    perception = make_perception()
    assert not perception.hand.ready
    with pytest.raises(DeviceError, match="hand: no joint angles"):
        tell(perception, kind)
    perception.on_hand(FakeHandSample(0, BEND_rad))
    with pytest.raises(DeviceError, match="base: no position"):
        tell(perception, kind)


def test_marks_survive_their_written_form():
    for kind in EventKind:
        event = SessionEvent(kind, 123_456_789_012, ("FF", "TH") if kind is EventKind.TARE else FINGERS)
        assert SessionEvent.from_bytes(event.to_bytes()) == event


@pytest.mark.parametrize(
    "data",
    [b"", b"[]", b"{}", b'{"kind":"dance","stamp_ns":1}', b'{"kind":"tare","stamp_ns":1,"fingers":["XX"]}', b"\xff"],
)
def test_foreign_marks_are_refused(data):
    with pytest.raises(SessionError, match="mark"):
        SessionEvent.from_bytes(data)


class FeelingTip(FakeTip):
    """A fingertip that feels while it moves; nothing."""

    drift = np.zeros(6)

    def reading(self):
        return np.zeros(6)

    def touches(self, readings, world_R_distal):
        raise AssertionError("no carry asks for its contacts")

    def wrenches(self, readings, world_R_distal):
        return np.zeros((len(readings), 6))


def second_grasp(carried=False, **options):
    perception = make_perception(**options)
    hear(perception)
    grasp(perception)
    if carried:
        tell(perception, EventKind.HOLD_BEGIN)
        hear(perception, base_q=1.1 * BASE_q)
        tell(perception, EventKind.HOLD_END)
    return grasp(perception)


def test_what_stood_where_pushes_are_felt_has_a_noise_of_its_own():
    motors = SimulatedCalibration.from_package().motors
    stood = second_grasp(tip=FeelingTip, motors=motors).motion_sigma
    assert (stood.translation_m, stood.rotation_rad) == (CarryNoise.stood_m, CarryNoise.stood_rad)
    assert second_grasp(tip=FeelingTip, motors=motors, carried=True).motion_sigma is None
    assert second_grasp(tip=FeelingTip, motors=motors, stays=False).motion_sigma is None
    assert second_grasp(tip=FeelingTip).motion_sigma is None
    assert second_grasp(motors=motors).motion_sigma is None


class ShakenTip(FakeTip):
    """A fingertip in the hand's samples that hears vibrations of this many counts."""

    counts = 5

    def update(self, sample):
        super().update([np.zeros(3)])

    def vibration_at(self, stamp_ns):
        return (2000 + self.counts, 2000 - self.counts)


def hear_for(perception, from_ms, until_ms):
    for stamp_ms in range(from_ms, until_ms, 2):
        hear(perception, stamp_ns=stamp_ms * 1_000_000)


@pytest.mark.parametrize(("odometry", "heard"), [("touch", ("TH",)), ("palm", None)])
def test_a_slip_is_heard_from_the_capture_until_the_hold_ends(odometry, heard):
    tip = ShakenTip("TH", 0.7)
    perception = make_perception(slot_fingertips={"TH": tip}, settings=PerceptionSettings(odometry=odometry))
    hear(perception)
    tell(perception, EventKind.CAPTURE_BEGIN)
    hear_for(perception, 0, 200)
    tell(perception, EventKind.CAPTURE_END, 200_000_000)
    tell(perception, EventKind.HOLD_BEGIN, 200_000_000)
    hear_for(perception, 200, 400)
    assert perception.heard_slip is None
    tip.counts = 50
    hear_for(perception, 400, 600)
    tell(perception, EventKind.HOLD_END, 600_000_000)
    slip = perception.heard_slip
    assert (slip and slip.fingers) == heard
    hear_for(perception, 600, 800)
    assert perception.heard_slip == slip
