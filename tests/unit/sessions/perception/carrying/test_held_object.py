"""From the capture until the hold ends: which samples count."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose2, Pose3

from drivers.core.contacts import FINGERS, StepSigma
from drivers.core.fingertip import TipTouches
from drivers.core.poses import planar, spatial
from drivers.shadow.model.kinematics import JOINTS
from sessions.perception.carrying.carry import Carry
from sessions.perception.carrying.carry_record import LONGEST_SAMPLES, CarryRecord
from sessions.perception.carrying.held_object import HeldObject
from sessions.perception.hand_odometry import HandOdometry
from sessions.perception.touch_capture import Measured

CYCLE_ns = 10_000_000
STILL = np.zeros(len(JOINTS))


class TouchingTip:
    """Always touches, with 1 N along the distal frame's y."""

    def __init__(self):
        self.asked = 0

    def reading(self):
        self.asked += 1
        return np.array([0.0, -1.0, 0.0, 0.0, 0.0, 0.0])

    def touches(self, readings, world_R_distal):
        count = len(readings)
        along = np.tile([0.0, 1.0, 0.0], (count, 1))
        yes, no = np.ones(count, dtype=bool), np.zeros(count, dtype=bool)
        return TipTouches(np.tile([0.0, -0.007, 0.02], (count, 1)), along, np.ones(count), along, yes, no)

    def wrenches(self, readings, world_R_distal):
        return np.tile([0.0, -1.0, 0.0, 0.0, 0.0, 0.0], (len(readings), 1))

    @property
    def drift(self):
        return np.zeros(6)


def held(tips=None):
    return HeldObject({finger: TouchingTip() for finger in FINGERS} if tips is None else tips, "right")


def carry_by(watched, shift_m, count=60, first=0):
    for n in range(first, first + count):
        watched.on_hand(n * CYCLE_ns, STILL, forearm(shift_m * (n - first) / (count - 1), 0.0))


def test_what_is_felt_between_capture_and_release_is_one_carry():
    watched = held()
    assert not watched.is_watched
    watched.on_capture(0)
    carry_by(watched, 0.03)
    watched.on_hold(10 * CYCLE_ns)
    carry = watched.end_hold()
    assert carry.motion.x() == pytest.approx(0.03, abs=0.004)
    assert watched.carry is carry


def test_the_hand_is_watched_until_it_has_opened_and_left():
    watched = held()
    watched.on_capture(0)
    carry_by(watched, 0.03)
    watched.end_hold()
    assert watched.is_watched
    watched.on_left()
    assert not watched.is_watched


@pytest.mark.parametrize("opened_m", [0.0, 0.003])
def test_a_fingertip_that_touches_the_object_while_the_hand_opens_may_have_pushed_it(opened_m):
    watched = held()
    watched.on_capture(0)
    carry_by(watched, 0.0)
    watched.on_grasp(Measured(0, np.eye(4), (), ()))
    watched.end_hold()
    for n in range(60, 121):
        watched.on_hand(n * CYCLE_ns, STILL, forearm(0.0, -opened_m * (n - 60) / 60))
    watched.on_tare(121 * CYCLE_ns)
    known = watched.then_closed(StepSigma(0.0003, 0.005))
    felt_m = 0.8 * opened_m  # the first 0.12 of 0.6 s are those of fingertips that let go
    assert known.translation_m == pytest.approx(np.hypot(0.0003, felt_m), rel=0.05)


def forearm(x_m, y_m):
    found = np.eye(4)
    found[:3, 3] = [x_m, y_m, 0.3]
    return found


def test_an_object_that_was_left_is_not_watched():
    watched = held()
    watched.on_capture(0)
    watched.on_left()
    assert not watched.is_watched


def test_a_hold_without_a_capture_begins_with_the_hold():
    watched = held()
    watched.on_hold(0)
    carry_by(watched, 0.02)
    assert watched.end_hold().motion.x() == pytest.approx(0.02, abs=0.004)


def test_fingertips_that_tell_nothing_while_they_move_give_no_carry():
    watched = held({})
    watched.on_capture(0)
    assert not watched.is_watched
    assert watched.end_hold() is None


def test_a_hold_too_long_to_be_kept_gives_no_carry():
    record = CarryRecord({"FF": TouchingTip()})
    record.begin()
    for n in range(LONGEST_SAMPLES + 100):
        record.take(n * CYCLE_ns, STILL, np.eye(4))
    assert record.since(0) is None
    assert record.since((LONGEST_SAMPLES - 50) * CYCLE_ns) is not None


def test_a_fast_hand_is_sampled_at_the_slow_rate():
    tip = TouchingTip()
    record = CarryRecord({"FF": tip})
    record.begin()
    for n in range(1000):
        record.take(n * 1_000_000, STILL, np.eye(4))
    assert 100 <= tip.asked <= 112


def test_a_single_sample_is_no_carry():
    record = CarryRecord({"FF": TouchingTip()})
    record.begin()
    record.take(0, STILL, np.eye(4))
    assert record.since(0) is None


FELT = Carry(Pose2(0.02, 0.0, 0.3), StepSigma(0.003, 0.04), 0.004, 0.1, 0.0, 0.0, 0.0, ())
PALM = Pose3(spatial(Pose2(0.03, 0.01, 0.4), 0.002).matrix())


def test_the_hand_odometry_is_what_was_felt_on_the_table_and_the_palm_above_it():
    odometry = HandOdometry()
    odometry.begin(Pose3())
    odometry.end(PALM, FELT)
    taken = odometry.take(PALM)
    assert planar(taken.world).equals(FELT.motion, 1e-9)
    assert taken.world.z() == pytest.approx(0.002)
    assert taken.sigma == FELT.sigma


def test_two_carries_add_up_and_one_that_was_not_felt_leaves_the_usual_noise():
    odometry = HandOdometry()
    for carry in (FELT, FELT):
        odometry.begin(Pose3())
        odometry.end(PALM, carry)
    both = odometry.take(PALM)
    assert both.sigma.translation_m == pytest.approx(np.sqrt(2) * 0.003)
    assert planar(both.world).theta() == pytest.approx(0.6)
    for carry in (FELT, None):
        odometry.begin(Pose3())
        odometry.end(PALM, carry)
    assert odometry.take(PALM).sigma is None


def test_an_undone_grasp_returns_its_motion_and_how_well_that_is_known():
    odometry = HandOdometry()
    odometry.take(Pose3())
    odometry.begin(Pose3())
    odometry.end(PALM, FELT)
    odometry.take(PALM)
    odometry.undo()
    assert odometry.take(PALM).sigma == FELT.sigma


def test_what_the_fingertips_push_while_the_hand_closes_makes_the_place_less_certain():
    """All five fingertips push, 1 N each, more or less the same way, and nothing pushes back."""
    watched, before = held(), StepSigma(0.001, 0.01)
    watched.on_close(0)
    carry_by(watched, 0.0)
    watched.on_capture(60 * CYCLE_ns)
    assert 3.5 < watched.closing_N < 5.0
    assert watched.then_closed(before).translation_m > 0.008
    assert watched.then_closed(None) is None


def test_a_closing_whose_forces_balance_leaves_the_noise_as_it_was():
    watched, before = held(), StepSigma(0.001, 0.01)
    watched.on_close(0)
    watched.on_capture(60 * CYCLE_ns)
    assert watched.then_closed(before) == before
