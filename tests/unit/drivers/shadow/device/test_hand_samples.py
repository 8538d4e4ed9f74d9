"""What the hand sends back: angles, tactile slots, and the motors' readings in turn."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.motor_polling import MotorMemory, MotorPolling
from drivers.shadow.device.tactile_requests import BIOTAC_ROTATION, TactileQuestion, TactileRotation
from drivers.shadow.protocol import palm_codec
from drivers.shadow.protocol.motor_data import FromMotor, ToMotor
from tests.support.fake_palm import (
    MOTORS,
    CYCLE_ns,
    Rig,
)


def test_samples_carry_the_calibrated_angles_and_the_tactile_slots(rig: Rig) -> None:
    sample = rig.run(1)
    np.testing.assert_allclose(sample.joints_rad, rig.palm.joints_rad, atol=np.radians(0.3))
    assert sample.fresh
    assert (sample.tactile, sample.tactile_valid, sample.idle_us) == (bytes(range(80)), 31, 400)


def test_motors_are_asked_even_and_odd_in_turn_and_types_change_on_the_step_to_odd(rig: Rig) -> None:
    rig.run(40)
    asked = [(command.which_motors, command.from_motor_data_type) for command in rig.palm.commands[1:]]
    assert [which for which, _ in asked] == [index % 2 for index in range(len(asked))]
    odd_kinds, even_kinds = [kind for _, kind in asked[1::2]], [kind for _, kind in asked[2::2]]
    assert odd_kinds[: len(even_kinds)] == even_kinds


def test_slow_types_are_asked_at_their_period_and_of_both_halves() -> None:
    polling = MotorPolling()
    asked = Counter(polling.next(cycle * CYCLE_ns) for cycle in range(400))
    assert asked[0, FromMotor.TEMPERATURE] == asked[1, FromMotor.TEMPERATURE] == 4
    assert asked[0, FromMotor.VOLTAGE] == asked[1, FromMotor.VOLTAGE] == 2
    assert asked[1, FromMotor.FLAGS] > 50


def test_motor_readings_gather_both_halves_with_their_age(rig: Rig) -> None:
    rig.palm.temperature_C = np.arange(20) + 20
    rig.hand.set_targets({"FFJ3": 1.5})
    sample = rig.run(20)
    assert sample.motor.torque.tolist() == list(range(20))
    assert sample.motor.temperature_C.tolist() == list(range(20, 40))
    assert sample.motor.pwm[MOTORS.numbers["FFJ3"]] == 600
    assert (sample.stamp_ns - sample.motor.stamps_ns[FromMotor.FLAGS]).max() <= 100_000_000
    assert (sample.motor.stamps_ns[FromMotor.D_TERM] < 0).all()
    assert np.isnan(sample.motor.values[FromMotor.D_TERM]).all()


def test_slow_data_are_not_taken_for_a_torque() -> None:
    memory = MotorMemory()
    status = palm_codec.decode_status(bytes(232))
    memory.update(replace(status, motor_data_type=3, arrived=1, torque=np.full(10, 7, np.int16)), 1)
    memory.update(replace(status, motor_data_type=0xA, arrived=1, torque=np.full(10, 6, np.int16)), 2)
    memory.update(replace(status, motor_data_type=0xFFFF, arrived=1, torque=np.full(10, 5, np.int16)), 3)
    readings = memory.readings()
    assert readings.torque[0] == 7
    assert readings.torque_stamps_ns[0] == 1
    assert readings.stamps_ns[FromMotor.SLOW_MISC, 0] == 2


def test_biotacs_are_asked_in_their_rotation_of_fourteen() -> None:
    rig = Rig(HandSettings(tactile="biotac"))
    rig.hand.connect()
    rig.run(27)
    kinds = [command.tactile_data_type for command in rig.palm.commands[1:29]]
    assert kinds == [*BIOTAC_ROTATION] * 2
    assert BIOTAC_ROTATION[:2] == (1, 3)
    assert BIOTAC_ROTATION[2:] == tuple(range(5, 28, 2))
    assert TactileRotation("none").next() == 0
    asking = TactileRotation("biotac", names=True)
    first = [asking.next() for _ in range(2 * 3 * len(TactileQuestion))]
    assert first[0::2] == list((BIOTAC_ROTATION * 2)[: len(first) // 2])
    assert first[1::2] == [*TactileQuestion] * 3
    assert {asking.next() for _ in range(28)} == set(BIOTAC_ROTATION)
    rig.hand.close()


def test_every_command_demands_duty_cycles_from_all_motors(rig: Rig) -> None:
    rig.run(3)
    assert {command.to_motor_data_type for command in rig.palm.commands[1:]} == {ToMotor.DEMAND_PWM}
    assert {command.edc_command for command in rig.palm.commands[1:]} == {1}
