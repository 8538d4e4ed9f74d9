"""Limits of torque and duty cycle: readings over them, and pushing without end."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drivers.core.errors import DeviceError
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.motor_load import LoadLimits, LoadWatch
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol.motor_data import FromMotor
from drivers.shadow.protocol.palm_images import PALMS
from drivers.simulation.settings import SimulationSettings
from drivers.simulation.world import SimulatedWorld

MOTORS = MotorMap.load()


def watch(**limits: Any) -> LoadWatch:
    return LoadWatch(MOTORS, LoadLimits(**limits), np.full(20, 600.0), "hand")


def status(kind: FromMotor, motor: int, torque: int = 0, misc: int = 0) -> Any:
    """What the even or the odd motors say, one of them something special."""
    torques, miscs = np.zeros(10, np.int16), np.zeros(10, np.uint16)
    torques[motor >> 1], miscs[motor >> 1] = torque, misc & 0xFFFF
    heard = np.arange(motor & 1, 20, 2)
    return SimpleNamespace(motor_data_type=kind, heard_motors=heard, torque=torques, misc=miscs)


def test_torque_over_the_limit_stops_after_some_readings_and_names_the_motor() -> None:
    load = watch(torque_counts=400.0, exceptions={}, readings=3)
    for _ in range(2):
        assert load.fault(status(FromMotor.CURRENT, 5, torque=-401)) is None
    fault = load.fault(status(FromMotor.CURRENT, 5, torque=-401))
    assert fault is not None
    assert str(fault.error()).startswith(f"hand, {MOTORS.names[5]} (motor 5): stopped: torque over 400 counts")


def test_a_jerk_between_good_readings_passes() -> None:
    load = watch(torque_counts=400.0, exceptions={}, readings=2)
    for torque in (500, 100, 500, 100):
        assert load.fault(status(FromMotor.CURRENT, 4, torque=torque)) is None


def test_limits_of_single_joints() -> None:
    motor = MOTORS.numbers["WRJ1"]
    load = watch(torque_counts=100.0, exceptions={"WRJ1": 5000.0}, readings=1)
    assert load.fault(status(FromMotor.CURRENT, motor, torque=4000)) is None
    assert load.fault(status(FromMotor.CURRENT, motor, torque=5001)) is not None


def test_slow_data_hold_no_torque() -> None:
    assert watch(torque_counts=1.0, exceptions={}, readings=1).fault(status(FromMotor.SLOW_MISC, 3, torque=16)) is None


@pytest.mark.parametrize(("pwm", "over"), [(600, False), (-620, False), (-700, True), (1023, True)])
def test_a_motor_that_turns_harder_than_told(pwm: int, over: bool) -> None:
    fault = watch(readings=1).fault(status(FromMotor.PWM, 8, misc=pwm))
    assert (fault is not None) == over
    if fault is not None:
        assert "duty cycle over its limit of 600 counts" in str(fault.error())


def test_pushing_for_long_stops_and_a_rest_begins_anew() -> None:
    load, words = watch(stall_s=1.0), np.zeros(20, np.int16)
    words[7] = -600
    still_rad, rest = np.zeros(24), np.zeros(20, np.int16)
    assert load.stall(words, still_rad, 0) is None
    assert load.stall(rest, still_rad, 900_000_000) is None
    assert load.stall(words, still_rad, 1_000_000_000) is None
    assert load.stall(words, still_rad, 1_900_000_000) is None
    fault = load.stall(words, still_rad, 2_100_000_000)
    assert fault is not None
    assert "motor 7): stopped: stalled for 1 s at its largest duty cycle" in str(fault.error())


def test_a_joint_that_turns_has_not_stalled_however_long_it_is_pushed() -> None:
    load, words = watch(stall_s=1.0), np.full(20, 600, np.int16)
    for tenth in range(40):
        assert load.stall(words, np.full(24, 0.01 * tenth), tenth * 100_000_000) is None
    assert load.stall(words, np.full(24, 0.4), 5_200_000_000) is not None


def test_a_hand_that_pushes_stops_itself_at_the_next_cycle() -> None:
    world = SimulatedWorld(SimulationSettings(), 0)
    transport, sent = world.transports()["hand"], []
    send = transport.send
    transport.send = lambda payload: (sent.append(payload), send(payload))[1]  # type: ignore[method-assign,func-returns-value]
    settings = HandSettings(soft_start_s=0.0, load=LoadLimits(stall_s=0.05))
    hand = ShadowHand(transport, world.clock, world.calibration.joints, settings)
    hand.connect()
    hand.set_targets({"WRJ2": 0.4})
    with pytest.raises(DeviceError, match=r"WRJ2 .*: stopped: stalled for 0.05 s"):
        _exchange(hand, world, 200)
    assert not np.any(PALMS["0220"].decode_command(sent[-1]).motor_data)
    hand.close()


def _exchange(hand: ShadowHand, world: SimulatedWorld, cycles: int) -> None:
    for _ in range(cycles):
        hand.exchange()
        world.clock.sleep_until_ns(world.clock.now_ns() + 10_000_000)
