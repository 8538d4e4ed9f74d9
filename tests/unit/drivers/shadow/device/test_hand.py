"""The hand's lifecycle and its motion: demands, limits, stop and resume."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.clock import VirtualClock
from drivers.core.errors import DeviceError
from drivers.core.transports import ReplayTransport
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_samples import HandSample
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.model.gains import GainTable, JointGains
from drivers.shadow.model.kinematics import JOINT_INDEX
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol import palm_codec
from tests.support.fake_palm import (
    CALIBRATION,
    MOTORS,
    QUICK,
    Rig,
    statuses,
)


def angle(sample: HandSample, joint: str) -> float:
    return float(sample.joints_rad[JOINT_INDEX[joint]])


def test_connecting_sends_the_all_zero_image_first_and_moves_nothing(rig: Rig) -> None:
    assert palm_codec.encode_command(rig.palm.commands[0]) == bytes(70)
    start_rad = rig.palm.joints_rad.copy()
    rig.run(20)
    assert not any(any(command.motor_data) for command in rig.palm.commands)
    np.testing.assert_array_equal(rig.palm.joints_rad, start_rad)


def test_connecting_twice_and_closing_twice_is_harmless() -> None:
    rig = Rig()
    rig.hand.connect()
    sent = len(rig.palm.commands)
    rig.hand.connect()
    assert len(rig.palm.commands) == sent
    rig.hand.close()
    sent = len(rig.palm.commands)
    rig.hand.close()
    assert len(rig.palm.commands) == sent


def test_a_silent_palm_is_not_connected_and_its_link_is_closed_again() -> None:
    rig = Rig()
    rig.palm.mute = True
    with pytest.raises(DeviceError, match="hand: the palm sent no valid status in 20 cycles"):
        rig.hand.connect()
    with pytest.raises(DeviceError, match="not connected"):
        rig.hand.exchange()
    rig.palm.mute = False
    rig.hand.connect()
    assert rig.run(1).fresh
    rig.hand.close()


def test_closing_sends_zero_demands_for_several_cycles(rig: Rig) -> None:
    rig.hand.set_targets({"FFJ3": 1.2})
    rig.run(5)
    assert any(rig.palm.pwm)
    rig.hand.close()
    assert not any(any(command.motor_data) for command in rig.palm.commands[-5:])
    with pytest.raises(DeviceError, match="not connected"):
        rig.hand.exchange()


def test_a_device_that_fails_while_closing_is_reported_and_still_closed() -> None:
    clock, rig = VirtualClock(), Rig()
    rig.hand.connect()
    recorded = list(statuses(rig, 1))
    transport = ReplayTransport("hand", [[], *recorded])
    hand = ShadowHand(transport, clock, CALIBRATION, QUICK, MOTORS)
    hand.connect()
    with pytest.raises(DeviceError, match="recording has ended"):
        hand.close()
    hand.close()


@settings(max_examples=15, deadline=None, derandomize=True)
@given(st.lists(st.floats(0.02, 0.98), min_size=20, max_size=20))
def test_every_driven_joint_reaches_its_target(shares: list[float]) -> None:
    rig = Rig()
    rig.hand.connect()
    limits = MOTORS.limits_rad
    targets = {
        name: float(limits[motor, 0] + share * np.ptp(limits[motor]))
        for motor, (name, share) in enumerate(zip(MOTORS.names, shares, strict=True))
    }
    rig.hand.set_targets(targets)
    rig.run(350)
    reached = dict(zip(MOTORS.names, MOTORS.from_joints @ rig.palm.joints_rad, strict=True))
    for name, target in targets.items():
        assert reached[name] == pytest.approx(target, abs=0.01), name
    rig.hand.close()


def test_the_coupled_pair_is_controlled_on_the_sum_of_both_sensors(rig: Rig) -> None:
    rig.hand.set_targets({"FFJ0": 1.1})
    sample = rig.run(200)
    assert angle(sample, "FFJ1") + angle(sample, "FFJ2") == pytest.approx(1.1, abs=0.006)
    assert angle(sample, "FFJ2") - angle(sample, "FFJ1") == pytest.approx(0.1, abs=0.01)  # the split was left alone


def test_targets_are_clamped_to_the_joint_limits(rig: Rig) -> None:
    rig.hand.set_targets({"FFJ0": 9.0, "THJ5": -9.0, "WRJ1": 9.0})
    assert rig.hand.targets_rad == pytest.approx(
        {"FFJ0": np.pi, "THJ5": np.radians(-60), "WRJ1": np.radians(28)}, abs=1e-12
    )


@pytest.mark.parametrize("bad", [{"FFJ1": 0.1}, {"FFJ3": 0.1, "XXJ1": 0.2}, {"FFJ3": float("nan")}])
def test_a_wrong_target_changes_nothing_at_all(rig: Rig, bad: dict[str, float]) -> None:
    rig.hand.set_targets({"MFJ3": 0.5})
    with pytest.raises(DeviceError, match="hand"):
        rig.hand.set_targets(bad)
    assert rig.hand.targets_rad == {"MFJ3": 0.5}


def test_demands_stay_within_each_motors_limit_and_stop_inside_the_dead_band() -> None:
    gains = GainTable(exceptions={"FFJ3": JointGains(pwm_per_rad=1000, deadband_rad=0.05, max_pwm=123)})
    rig = Rig(HandSettings(soft_start_s=0.0, gains=gains))
    rig.hand.connect()
    rig.hand.set_targets({"FFJ3": 1.4, "MFJ3": 1.4})
    rig.run(1)
    assert rig.palm.pwm[MOTORS.numbers["FFJ3"]] == 123
    assert rig.palm.pwm[MOTORS.numbers["MFJ3"]] == 600
    assert Counter(rig.palm.pwm)[0] == 18
    rig.hand.set_targets({"FFJ3": float(rig.palm.joints_rad[JOINT_INDEX["FFJ3"]]) + 0.045})
    rig.run(1)
    assert rig.palm.pwm[MOTORS.numbers["FFJ3"]] == 0
    rig.hand.close()


def test_a_reversed_motor_gets_demands_of_the_other_sign() -> None:
    rig = Rig(motors=MotorMap(MOTORS.numbers, ("FFJ3",)))
    rig.hand.connect()
    rig.hand.set_targets({"FFJ3": 1.0})
    rig.run(1)
    assert rig.palm.pwm[MOTORS.numbers["FFJ3"]] < 0
    assert angle(rig.run(200), "FFJ3") == pytest.approx(1.0, abs=0.006)
    rig.hand.close()


def test_the_first_move_starts_softly() -> None:
    rig = Rig(HandSettings(soft_start_s=0.5))
    rig.hand.connect()
    rig.hand.set_targets({"MFJ3": 1.5})
    strongest = []
    for _ in range(60):
        rig.run(1)
        strongest.append(max(map(abs, rig.palm.pwm)))
    assert strongest[0] == 0
    assert strongest[10] == pytest.approx(120, abs=1)
    assert max(strongest) == 600
    rig.hand.close()


def test_stop_takes_the_demands_away_until_resume_and_forgets_the_targets(rig: Rig) -> None:
    rig.hand.set_targets({"FFJ3": 1.5})
    rig.run(3)
    rig.hand.stop()
    rig.run(5)
    assert not any(any(command.motor_data) for command in rig.palm.commands[-5:])
    rig.hand.resume()
    rig.run(3)
    assert not any(rig.palm.pwm)
    rig.hand.set_targets({"FFJ3": 1.5})
    rig.run(1)
    assert any(rig.palm.pwm)


def test_stop_does_not_raise_on_a_hand_that_was_never_connected() -> None:
    Rig().hand.stop()
