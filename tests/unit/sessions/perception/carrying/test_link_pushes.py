"""Links that push while the hand closes, as the motors' strain gauges show them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from drivers.core.contacts import FINGERS, StepSigma
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINTS
from drivers.shadow.model.motors import MotorMap
from drivers.simulation.calibration import SimulatedCalibration
from sessions.perception.carrying.carry_record import CarryRecord, CarrySamples
from sessions.perception.carrying.held_object import HeldObject
from sessions.perception.carrying.links.link_pushes import LinkPushes, until_it_rises
from sessions.perception.instruments import motor_torques
from sessions.perception.touch_capture import Measured
from tactile_lab.rigs.description import load_rig
from tests.support.wrench_tip import WrenchTip

MOTORS = SimulatedCalibration.from_package().motors
COUNT, STEP_s = 200, 0.01
PUSH = slice(90, 140)
"""Half a second in which something is pushed."""


TIPS = {finger: WrenchTip() for finger in FINGERS}


def closing(chance: np.random.Generator, *, start_rad: float = 0.3, sign: float = 1.0) -> CarrySamples:
    """Fingers that close freely (or open, by ``sign``): their motors work against friction, damping and inertia."""
    speed = sign * 0.25 * np.clip(np.arange(COUNT) / 20, 0.0, 1.0) * (1 + 0.4 * np.sin(0.05 * np.arange(COUNT)))
    bends = np.array([name[-1] in "123" and not name.startswith("WR") for name in JOINTS])
    joints_rad = start_rad + np.cumsum(speed)[:, None] * STEP_s * bends
    speeds = np.gradient(joints_rad @ MOTORS.from_joints.T, STEP_s, axis=0)
    counts = 3.0 + 25 * speeds + 8 * np.tanh(speeds / 0.05) + np.gradient(speeds, STEP_s, axis=0)
    counts = MOTORS.sign * counts + 2.0 * chance.standard_normal(counts.shape)
    stamps_ns = 1e9 * STEP_s * np.arange(COUNT)
    return CarrySamples(stamps_ns, joints_rad, np.tile(np.eye(4), (COUNT, 1, 1)), np.zeros((COUNT, 5, 6)), counts)


def opening(chance: np.random.Generator) -> CarrySamples:
    """Fingers that open freely, while the hand rests; it rises in the last quarter of the time."""
    places = np.tile(np.eye(4), (COUNT, 1, 1))
    places[:, 2, 3] = 0.2 + 0.0005 * np.maximum(np.arange(COUNT) - 150, 0)
    return replace(closing(chance, start_rad=1.0, sign=-1.0), world_T_forearm=places)


def still(chance: np.random.Generator) -> CarrySamples:
    """An open hand."""
    joints_rad = np.tile(closing(chance).joints_rad[0], (COUNT, 1))
    return replace(closing(chance), joints_rad=joints_rad, motor_counts=2.0 * chance.standard_normal((COUNT, 20)))


def pushing(samples: CarrySamples, joint: str, counts: float = 40.0, during: slice = PUSH) -> CarrySamples:
    """The same with a link that works against something."""
    assert samples.motor_counts is not None
    changed = samples.motor_counts.copy()
    changed[during, MOTORS.numbers[joint]] += counts
    return replace(samples, motor_counts=changed)


def watched(chance: np.random.Generator) -> LinkPushes:
    """After two free closings."""
    links = LinkPushes(MOTORS, TIPS, "right")
    assert [links.closed_s(closing(chance)) for _ in range(2)] == [0.0, 0.0]
    return links


@pytest.mark.parametrize("joint", ["RFJ3", "LFJ5", "FFJ0", "THJ5"])
def test_a_link_that_pushes_is_noticed_for_as_long_as_it_does(joint: str) -> None:
    chance = np.random.default_rng(1)
    assert watched(chance).closed_s(pushing(closing(chance), joint)) == pytest.approx(0.5, abs=0.06)
    assert watched(chance).closed_s(pushing(closing(chance), joint, -40.0)) == pytest.approx(0.5, abs=0.06)


def test_times_of_several_fingers_add_up_and_those_of_one_fingers_motors_do_not() -> None:
    chance = np.random.default_rng(2)
    two_motors = pushing(pushing(closing(chance), "RFJ3"), "RFJ4")
    assert watched(chance).closed_s(two_motors) == pytest.approx(0.5, abs=0.06)
    assert watched(chance).closed_s(pushing(two_motors, "LFJ3")) == pytest.approx(1.0, abs=0.12)


def test_a_short_jerk_is_no_push() -> None:
    chance = np.random.default_rng(4)
    assert watched(chance).closed_s(pushing(closing(chance), "RFJ3", during=slice(90, 93))) == 0.0


def test_what_the_fingertip_itself_does_is_no_push_of_a_link() -> None:
    chance = np.random.default_rng(5)
    touching = pushing(closing(chance), "RFJ3")
    touching.readings[PUSH.start - 10 :, FINGERS.index("RF"), 1] = 0.5
    assert watched(chance).closed_s(touching) == 0.0


def test_a_link_that_pushes_in_the_second_closing_is_no_free_motion_of_its_finger() -> None:
    """Of the finger little more is known than that closing; its neighbours tell how it moves freely."""
    chance = np.random.default_rng(13)
    links = LinkPushes(MOTORS, TIPS, "right")
    short = closing(chance)
    short.readings[20:, :, 1] = 0.5
    assert links.closed_s(short) == 0.0
    pushed = pushing(closing(chance), "MFJ3", during=slice(0, 110))
    pushed.readings[110:, FINGERS.index("MF"), 1] = 0.5
    assert links.closed_s(pushed) > 0.5


def test_a_joint_that_presses_against_its_own_end_is_no_push() -> None:
    chance = np.random.default_rng(6)
    ended = closing(chance)
    ended.joints_rad[PUSH.start - 10 :, JOINT_INDEX["THJ2"]] = np.radians(39.0)
    assert watched(chance).closed_s(pushing(ended, "THJ2", 150.0)) == 0.0


def test_fingers_without_a_force_sensor_tell_nothing() -> None:
    chance = np.random.default_rng(7)
    links = LinkPushes(MOTORS, {"FF": WrenchTip()}, "right")
    assert links.closed_s(pushing(closing(chance), "RFJ3")) == 0.0


def test_a_hand_that_does_not_report_its_motors_tells_nothing() -> None:
    silent = replace(closing(np.random.default_rng(8)), motor_counts=None)
    assert LinkPushes(MOTORS, TIPS, "right").closed_s(silent) == 0.0


def test_a_link_that_lands_on_something_is_noticed_while_the_fingers_stand_still() -> None:
    chance = np.random.default_rng(11)
    standing = still(chance)
    links = LinkPushes(MOTORS, TIPS, "right")
    assert links.landed_s(standing) == 0.0
    landed = pushing(standing, "MFJ3", 60.0, slice(90, 120))
    assert links.landed_s(landed) == pytest.approx(0.3, abs=0.05)
    assert links.landed_s(pushing(landed, "WRJ1", 400.0)) == pytest.approx(0.3, abs=0.05)


def test_fingers_that_open_on_the_way_down_land_on_nothing() -> None:
    assert LinkPushes(MOTORS, TIPS, "right").landed_s(closing(np.random.default_rng(12))) == 0.0


def test_motors_that_scatter_more_hide_more() -> None:
    chance = np.random.default_rng(9)
    links = LinkPushes(MOTORS, TIPS, "right")
    for _ in range(3):
        rough = closing(chance)
        assert rough.motor_counts is not None
        rubbing = np.repeat(60.0 * chance.standard_normal((COUNT // 8, 20)), 8, axis=0)
        assert links.closed_s(replace(rough, motor_counts=rough.motor_counts + rubbing)) < 0.3


def test_a_hand_with_fewer_motors_tells_what_its_own_do() -> None:
    motors = MotorMap.load(load_rig("sim-lite").files["motors"])
    silent = np.where(motors.is_fitted, 7.0, np.nan)
    assert motor_torques(SimpleNamespace(motor=SimpleNamespace(torque=silent))) is None
    counts = motor_torques(SimpleNamespace(motor=SimpleNamespace(torque=silent)), motors.is_fitted)
    assert counts is not None
    assert counts.tolist() == np.where(motors.is_fitted, 7.0, 0.0).tolist()
    chance, tips = np.random.default_rng(14), {finger: WrenchTip() for finger in ("FF", "MF", "RF", "TH")}
    links = LinkPushes(motors, tips, "right")
    for joint, expected_s in ((None, 0.0), (None, 0.0), ("RFJ3", 0.5)):
        taken = closing(chance) if joint is None else pushing(closing(chance), joint)
        assert taken.motor_counts is not None
        own = np.zeros_like(taken.motor_counts)
        for name in motors.driven:
            own[:, motors.numbers[name]] = taken.motor_counts[:, MOTORS.numbers[name]]
        assert links.closed_s(replace(taken, motor_counts=own)) == pytest.approx(expected_s, abs=0.06)


def test_samples_keep_what_motors_reported_only_if_all_did() -> None:
    record = CarryRecord(TIPS)
    record.begin()
    for n in range(4):
        counts = None if n == 0 else np.full(20, float(n))
        record.take(n * 10_000_000, np.zeros(len(JOINTS)), np.eye(4), counts)
    everything, later = record.since(0), record.since(10_000_000)
    assert everything is not None
    assert everything.motor_counts is None
    assert later is not None
    assert later.motor_counts is not None
    assert later.motor_counts[:, 0].tolist() == [1.0, 2.0, 3.0]


def test_a_push_widens_the_noise_of_the_step_that_it_ends() -> None:
    chance = np.random.default_rng(10)
    held = HeldObject(TIPS, "right", 1.0, MOTORS)
    for number, taken in enumerate([closing(chance), closing(chance), pushing(closing(chance), "RFJ3")]):
        _close(held, taken, from_ns=number * 10**10)
    assert held.links.times.closed_s == pytest.approx(0.5, abs=0.06)
    known = StepSigma(0.0004, np.radians(0.3))
    widened = held.then_closed(known)
    assert widened is not None
    assert widened.translation_m == pytest.approx(
        np.hypot(0.0004, held.odometry.noise.links_m * held.links.times.closed_s**1.25)
    )
    assert widened.rotation_rad > 2 * known.rotation_rad


def test_what_motors_show_on_the_way_up_again_is_no_landing() -> None:
    landed = pushing(still(np.random.default_rng(14)), "RFJ3", 60.0, slice(90, 120))
    places = np.tile(np.eye(4), (COUNT, 1, 1))
    links = LinkPushes(MOTORS, TIPS, "right")
    for lowest, seconds in ((60, 0.0), (130, 0.3)):
        places[:, 2, 3] = 0.2 + 0.0005 * np.abs(np.arange(COUNT) - lowest)
        assert links.landed_s(replace(landed, world_T_forearm=places)) == pytest.approx(seconds, abs=0.05)


def test_a_link_that_pushes_while_the_hand_opens_is_heard_until_it_rises() -> None:
    chance, links = np.random.default_rng(15), LinkPushes(MOTORS, TIPS, "right")

    def opened_s(samples: CarrySamples) -> float:
        cut = until_it_rises(samples)
        assert cut is not None
        return links.opened_s(cut)

    assert [opened_s(opening(chance)) for _ in range(2)] == [0.0, 0.0]
    assert opened_s(pushing(opening(chance), "RFJ3", -40.0, slice(60, 100))) == pytest.approx(0.4, abs=0.06)
    assert opened_s(pushing(opening(chance), "RFJ3", -40.0, slice(160, 200))) == 0.0
    assert links.closed_s(closing(chance)) == 0.0


def test_what_an_opening_pushed_counts_in_the_step_that_it_begins() -> None:
    chance, known = np.random.default_rng(16), StepSigma(0.0004, np.radians(0.3))
    held = HeldObject(TIPS, "right", 1.0, MOTORS)
    free, pushed = closing(chance), pushing(closing(chance), "RFJ3")
    opened = pushing(opening(chance), "RFJ3", -40.0, slice(60, 100))
    cycles = [(free, opening(chance)), (pushed, opened), (free, opening(chance)), (free, opening(chance))]
    widened = [_grasp_and_let_go(held, *cycle, known, from_ns=at * 10**11) for at, cycle in enumerate(cycles)]
    of_link = held.odometry.noise.links_m
    pushes_m = [0.0, of_link * 0.5**1.25, of_link * 0.4**1.25, 0.0]
    assert widened == pytest.approx(np.hypot(0.0004, pushes_m), rel=0.1)


def test_landings_of_all_tries_count_until_the_next_descent() -> None:
    chance, known = np.random.default_rng(13), StepSigma(0.0004, np.radians(0.3))
    landed, held = pushing(still(chance), "RFJ3", 60.0, slice(90, 120)), HeldObject(TIPS, "right", 1.0, MOTORS)
    for number, taken in enumerate([landed, landed, still(chance)]):
        held.on_tare(number * 10**10)
        _watch(held, taken, number * 10**10)
    held.on_close(3 * 10**10)
    assert held.links.times.landed_s == pytest.approx(0.6, abs=0.1)
    held.on_capture(4 * 10**10)
    held.on_grasp(Measured(4 * 10**10, np.eye(4), (), ()))
    widened = held.then_closed(known)
    assert widened is not None
    assert widened.translation_m == pytest.approx(
        np.hypot(0.0004, held.odometry.noise.landed_m_s * held.links.times.landed_s)
    )
    held.on_tare(5 * 10**10)
    assert held.links.times.landed_s == 0.0


def _grasp_and_let_go(
    held: HeldObject, closed: CarrySamples, let_go: CarrySamples, known: StepSigma, from_ns: int
) -> float:
    """What is known of the object's place once the hand has closed around it; then it is let go of."""
    held.on_tare(from_ns)
    _close(held, closed, from_ns + 10**10)
    held.on_grasp(Measured(from_ns + 2 * 10**10, np.eye(4), (), ()))
    sigma = held.then_closed(known)
    assert sigma is not None
    _watch(held, still(np.random.default_rng(17)), from_ns + 2 * 10**10)
    held.end_hold()
    _watch(held, let_go, from_ns + 2 * 10**10 + COUNT * 10_000_000)
    return sigma.translation_m


def _watch(held: HeldObject, taken: CarrySamples, from_ns: int) -> None:
    assert taken.motor_counts is not None
    for n in range(COUNT):
        held.on_hand(from_ns + n * 10_000_000, taken.joints_rad[n], taken.world_T_forearm[n], taken.motor_counts[n])


def _close(held: HeldObject, taken: CarrySamples, from_ns: int) -> None:
    held.on_close(from_ns)
    _watch(held, taken, from_ns)
    held.on_capture(from_ns + COUNT * 10_000_000)
