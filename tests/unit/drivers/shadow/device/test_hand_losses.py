"""Lost cycles, links that are gone, flags, heat and silent motors: what the hand does and what it says."""

from __future__ import annotations

from contextlib import nullcontext
from typing import Literal

import numpy as np
import pytest

from drivers.core.errors import DeviceError
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.protocol.motor_data import MotorFlag
from tests.support.fake_palm import (
    MOTORS,
    Rig,
)


@pytest.mark.parametrize("trouble", ["mute", "unwritten", "frozen"])
def test_a_lost_cycle_repeats_the_last_sample_as_not_fresh(rig: Rig, trouble: str) -> None:
    good = rig.run(1)
    setattr(rig.palm, trouble, True)
    held = rig.run(1)
    assert not held.fresh
    assert held.stamp_ns == good.stamp_ns
    np.testing.assert_array_equal(held.joints_rad, good.joints_rad)
    setattr(rig.palm, trouble, False)
    assert rig.run(1).fresh
    assert rig.hand.counters.lost == 1
    assert any("1 of" in problem for problem in rig.hand.health())


def test_demands_pause_while_the_hand_is_blind_and_return_with_its_status(rig: Rig) -> None:
    rig.hand.set_targets({"FFJ3": 1.5})
    rig.run(2)
    rig.palm.unwritten = True
    demands = []
    for _ in range(4):
        rig.run(1)
        demands.append(any(rig.palm.pwm))
    assert demands == [True, True, False, False]
    rig.palm.unwritten = False
    rig.run(2)
    assert any(rig.palm.pwm)


def test_a_link_that_is_gone_for_longer_than_its_patience_stops_the_hand(rig: Rig) -> None:
    rig.hand.set_targets({"FFJ3": 1.5})
    rig.palm.mute = True
    rig.run(201)
    with pytest.raises(DeviceError, match=r"hand: stopped: no valid status for 2 s\. Check the cable"):
        rig.run(1)
    rig.palm.mute = False
    with pytest.raises(DeviceError, match="no valid status"):
        rig.run(1)
    assert not any(rig.palm.pwm)
    rig.hand.resume()
    assert rig.run(2).fresh


def test_a_link_that_never_comes_back_after_a_resume_stops_the_hand_again(rig: Rig) -> None:
    rig.palm.mute = True
    with pytest.raises(DeviceError, match="no valid status"):
        rig.run(210)
    rig.hand.resume()
    with pytest.raises(DeviceError, match="no valid status"):
        rig.run(210)


def test_a_program_that_stood_still_gives_no_demand_on_an_old_status_and_stops_after_its_patience(rig: Rig) -> None:
    rig.hand.set_targets({"FFJ3": 1.5})
    rig.run(2)
    rig.clock.sleep_until_ns(rig.clock.now_ns() + 60_000_000)
    rig.run(1)
    assert not any(rig.palm.pwm)
    rig.run(1)
    assert any(rig.palm.pwm)
    rig.clock.sleep_until_ns(rig.clock.now_ns() + 2_100_000_000)
    with pytest.raises(DeviceError, match=r"stopped: the program stood still for 2\.1 s"):
        rig.run(1)
    assert not any(rig.palm.pwm)


def test_a_hand_that_is_not_driven_does_not_mind_that_the_program_stood_still(rig: Rig) -> None:
    rig.clock.sleep_until_ns(rig.clock.now_ns() + 60_000_000_000)
    assert rig.run(1).fresh


def test_messages_of_another_kind_count_as_lost_and_show_in_the_health(rig: Rig) -> None:
    rig.palm.garbage = bytes(231)
    assert not rig.run(3).fresh
    rig.palm.garbage = b""
    assert rig.hand.counters.malformed == 3
    assert "3 messages were not a status of a 0220 palm" in rig.hand.health()


@pytest.mark.parametrize(
    ("flag", "words"),
    [
        (MotorFlag.BRIDGE_FAULT, "H-bridge fault"),
        (MotorFlag.EEPROM_CRC_BAD, "stored configuration damaged"),
        (MotorFlag.OVER_TEMPERATURE, "over temperature"),
        (MotorFlag.NO_DEMAND, "no demand for 20 ms"),
    ],
)
def test_a_serious_flag_stops_the_hand_and_names_joint_motor_and_flag(rig: Rig, flag: MotorFlag, words: str) -> None:
    rig.hand.set_targets({"FFJ3": 1.5})
    rig.run(40)
    rig.palm.flags[12] = flag
    with pytest.raises(DeviceError, match=rf"hand, LFJ0 \(motor 12\): stopped: halted, {words}"):
        rig.run(20)
    assert not any(rig.palm.pwm)


@pytest.mark.parametrize(("demand", "stops"), [("pwm", False), ("torque", True)])
def test_a_faulty_strain_gauge_stops_a_hand_whose_motors_keep_torques(
    demand: Literal["pwm", "torque"], stops: bool
) -> None:
    rig = Rig(HandSettings(soft_start_s=0.0, demand=demand))
    rig.hand.connect()
    rig.palm.flags[12] = MotorFlag.GAUGE_LEFT_FAULT
    with pytest.raises(DeviceError, match="left strain gauge faulty") if stops else nullcontext():
        rig.run(20)


def test_motors_that_halted_before_the_demands_began_are_forgiven_at_first_only() -> None:
    rig = Rig()
    rig.palm.flags[:] = MotorFlag.NO_DEMAND
    rig.hand.connect()
    rig.run(20)
    with pytest.raises(DeviceError, match="no demand for 20 ms"):
        rig.run(40)
    rig.hand.close()


@pytest.mark.parametrize(("way_ms", "forgiven"), [(12, True), (8, False)])
def test_a_pause_of_the_host_and_one_of_the_wire_that_add_up_let_motors_report_that_they_had_halted(
    rig: Rig, way_ms: int, forgiven: bool
) -> None:
    rig.run(40)
    rig.palm.delay_ns = way_ms * 1_000_000
    rig.run(1)  # 10 ms after the command before it
    rig.palm.delay_ns = 0
    rig.palm.flags[:] = MotorFlag.NO_DEMAND
    with nullcontext() if forgiven else pytest.raises(DeviceError, match="no demand for 20 ms"):
        rig.run(8)


def test_a_pause_of_the_host_lets_motors_report_that_they_had_halted(rig: Rig) -> None:
    rig.run(40)
    rig.clock.sleep_until_ns(rig.clock.now_ns() + 500_000_000)
    rig.palm.flags[:] = MotorFlag.NO_DEMAND
    rig.run(15)
    rig.palm.flags[:] = 0
    rig.run(40)


def test_harmless_flags_show_in_the_health_only(rig: Rig) -> None:
    rig.palm.flags[3] = MotorFlag.JIGGLING
    rig.run(30)
    assert "hand, MFJ0 (motor 3): zeroing its strain gauges, not controlled" in rig.hand.health()


def test_a_warm_motor_gets_half_its_limit_and_a_hot_one_stops_the_hand(rig: Rig) -> None:
    motor = MOTORS.numbers["MFJ3"]
    rig.palm.temperature_C[motor] = 51
    rig.run(10)
    rig.hand.set_targets({"MFJ3": 1.5, "FFJ3": 1.5})
    rig.run(1)
    assert rig.palm.pwm[motor] == 300
    assert rig.palm.pwm[MOTORS.numbers["FFJ3"]] == 600
    assert any("MFJ3 (motor 11): warm, 51 C" in problem for problem in rig.hand.health())
    rig.palm.temperature_C[motor] = 55
    with pytest.raises(DeviceError, match=r"MFJ3 \(motor 11\): stopped: 55 C, limit 55 C"):
        rig.run(120)


def test_a_silent_motor_is_named_in_the_health(rig: Rig) -> None:
    rig.palm.silent = {19}
    rig.run(60)
    assert rig.hand.health() == ("hand, THJ5 (motor 19): silent",)


def test_a_sound_hand_has_nothing_to_report(rig: Rig) -> None:
    rig.run(60)
    assert rig.hand.health() == ()
