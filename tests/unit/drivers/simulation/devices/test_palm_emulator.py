"""The emulated palm: statuses, joint sensors, motor boards, and control through them."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.errors import CodecError
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINTS
from drivers.shadow.model.motors import DRIVEN_JOINTS, angles_of_driven
from drivers.shadow.protocol import palm_codec
from drivers.shadow.protocol.motor_data import FromMotor, MotorFlag, ToMotor, config_upload
from drivers.shadow.protocol.palm_codec import EdcCommand, PalmCommand
from drivers.shadow.protocol.palm_codec import decode_status as decode_palm
from drivers.simulation.devices.geared_motors import DISTAL_COUPLING, motor_class
from drivers.simulation.settings import JointSensorSettings, SimulationSettings
from tests.support.simulated_program import MOTORS, MS, Program, records


def test_palm_writes_nothing_before_it_is_asked_for_data() -> None:
    program = Program()
    assert not any(program.ask(edc_command=EdcCommand.INVALID).payload)
    assert not any(program.ask().payload)
    assert decode_palm(program.ask().payload).written


def test_status_answers_the_command_before() -> None:
    program = Program()
    program.ask(from_motor_data_type=FromMotor.CURRENT, which_motors=1, tactile_data_type=4)
    status = decode_palm(program.ask(from_motor_data_type=FromMotor.FLAGS, which_motors=0).payload)
    assert (status.motor_data_type, status.which_motors, status.tactile_data_type) == (FromMotor.CURRENT, 1, 4)
    assert status.arrived == 0xAAAAA
    assert status.tactile_valid == 0
    assert decode_palm(program.ask().payload).arrived == 0x55555


def test_wrong_length_is_no_command() -> None:
    with pytest.raises(CodecError, match="69 bytes"):
        Program().transports["hand"].send(bytes(69))


def test_joint_sensors_tell_the_true_angles_within_their_resolution() -> None:
    program = Program()
    program.drive({"FFJ3": 150, "THJ4": -200, "MFJ0": 120}, 30)
    measured, true = program.joints_rad(), program.plant.joints_rad
    assert np.degrees(np.abs(measured - true)).max() < 0.25


def test_joint_sensors_carry_a_bias_through_the_session() -> None:
    program = Program(SimulationSettings(), seed=4)
    readings = []
    for _ in range(40):
        readings.append(np.degrees(program.joints_rad() - program.plant.joints_rad))
    mean, noise = np.mean(readings, axis=0), np.std(readings, axis=0)
    fingers = ~np.char.startswith(JOINTS, "WR")
    assert 0.3 < np.std(mean[fingers]) < 1.0
    assert 0.07 < np.median(noise) < 0.25


def test_channels_without_hardware_keep_their_index() -> None:
    status = Program().status()
    assert status.sensors[26:32].tolist() == list(range(26, 32))  # without hardware: their own numbers
    assert status.sensors[36] == 0


@pytest.mark.parametrize("joint", DRIVEN_JOINTS)
def test_positive_duty_turns_its_joint_to_larger_angles(joint: str) -> None:
    program = Program()
    before = program.plant.joints_rad
    program.drive({joint: 150}, 8)
    turned = program.plant.joints_rad - before
    rows = [JOINT_INDEX[name] for name in angles_of_driven(joint)]
    others = np.delete(turned, rows)
    assert turned[rows].sum() > np.radians(0.5)
    assert np.abs(others).max() < turned[rows].sum()


def test_outer_finger_joint_trails_the_middle_one() -> None:
    program = Program()
    program.drive({"RFJ0": 300}, 60)
    program.drive({}, 20)
    joints = program.plant.joints_rad
    outer, middle = joints[JOINT_INDEX["RFJ1"]], joints[JOINT_INDEX["RFJ2"]]
    assert middle > 0.5
    assert outer / middle == pytest.approx(DISTAL_COUPLING, abs=0.1)


def test_motors_halt_20_ms_after_the_last_demand() -> None:
    program = Program()
    program.drive({"FFJ3": 200}, 3)
    moving = program.plant.joints_rad[JOINT_INDEX["FFJ3"]]
    program.wait(12 * MS)
    status = program.status(from_motor_data_type=FromMotor.FLAGS, which_motors=1)
    assert np.all(status.misc & int(MotorFlag.NO_DEMAND))
    assert moving > 0
    assert not program.status(from_motor_data_type=FromMotor.PWM, which_motors=1).misc.any()
    program.wait(100 * MS)
    halted = program.plant.joints_rad[JOINT_INDEX["FFJ3"]]
    program.wait(100 * MS)
    assert program.plant.joints_rad[JOINT_INDEX["FFJ3"]] == pytest.approx(halted, abs=2e-3)


def test_a_demand_wakes_halted_motors() -> None:
    program = Program()
    assert np.all(program.status(from_motor_data_type=FromMotor.FLAGS).misc & int(MotorFlag.NO_DEMAND))
    program.drive({}, 1)
    assert not program.status(from_motor_data_type=FromMotor.FLAGS).misc.any()


def test_motors_echo_their_duty_and_show_their_load() -> None:
    program = Program()
    program.drive({"THJ4": 300}, 40)  # against its upper limit
    motor = MOTORS.numbers["THJ4"]
    asked = {"which_motors": motor % 2, "to_motor_data_type": 2, "motor_data": np.where(np.arange(20) == motor, 300, 0)}
    assert program.status(from_motor_data_type=FromMotor.PWM, **asked).misc[motor // 2] == 300
    current = program.status(from_motor_data_type=FromMotor.CURRENT, **asked)
    stall_mA = motor_class("THJ4").stall_current_mA
    assert current.misc[motor // 2] == pytest.approx(stall_mA * 300 / 1023, rel=0.1)
    assert current.torque[motor // 2] > 200
    assert program.status(from_motor_data_type=FromMotor.VOLTAGE, **asked).misc[0] / 256 == pytest.approx(24.0)
    assert 25.0 <= program.status(from_motor_data_type=FromMotor.TEMPERATURE, **asked).misc[0] / 256 < 30.0


def upload(program: Program, words: list[int], spoil: int = 0) -> None:
    motor = MOTORS.numbers["FFJ3"]
    for kind, word in config_upload(words):
        data = np.zeros(20, int)
        data[motor] = np.int16(np.uint16(word ^ (spoil if kind is ToMotor.CONFIG_CRC else 0)))
        program.ask(to_motor_data_type=kind, motor_data=data)


CONFIG = [500, 64, 120, 0, 300, 4500, 0, 0, 0, 5]


def test_uploaded_limit_caps_the_duty() -> None:
    program = Program()
    upload(program, CONFIG)
    program.drive({"FFJ3": 900, "MFJ3": 900}, 1)
    duty = program.status(from_motor_data_type=FromMotor.PWM, which_motors=1).misc
    assert duty[MOTORS.numbers["FFJ3"] // 2] == 120
    assert duty[MOTORS.numbers["MFJ3"] // 2] == 900


def test_configuration_with_a_wrong_checksum_is_flagged_and_not_taken() -> None:
    program = Program()
    upload(program, CONFIG, spoil=1)
    flags = program.status(from_motor_data_type=FromMotor.FLAGS, which_motors=1).misc
    assert flags[MOTORS.numbers["FFJ3"] // 2] & int(MotorFlag.CONFIG_CRC_MISMATCH)
    program.drive({"FFJ3": 900}, 1)
    assert program.status(from_motor_data_type=FromMotor.PWM, which_motors=1).misc[0] == 900


def test_reset_motor_stands_still_until_the_next_demand() -> None:
    program = Program()
    program.drive({"FFJ3": 300}, 1)
    program.ask(to_motor_data_type=ToMotor.RESET, motor_data=np.where(np.arange(20) == 1, 0x5200 | 1, 0))
    assert program.status(from_motor_data_type=FromMotor.PWM, which_motors=1).misc[0] == 0


def test_slow_data_name_their_type_in_the_torque_word() -> None:
    program = Program()
    answers = [decode_palm(program.ask(from_motor_data_type=FromMotor.SLOW_MISC).payload) for _ in range(20)]
    gear = [answer.misc[0] for answer in answers if answer.torque[0] == 6]
    assert gear
    assert set(gear) == {131}


def test_unplugged_palm_is_silent_and_its_motors_halt() -> None:
    program = Program()
    program.drive({"FFJ3": 200}, 2)
    program.world.unplug("hand")
    for _ in range(5):
        program.transports["hand"].send(palm_codec.encode_command(PalmCommand(edc_command=EdcCommand.SENSOR_DATA)))
        assert program.transports["hand"].receive() == []
        program.wait()
    program.world.plug_in("hand")
    assert program.status(from_motor_data_type=FromMotor.FLAGS).misc[0] & int(MotorFlag.NO_DEMAND)


def test_proportional_control_tracks_a_ramp_and_settles() -> None:
    program = Program(SimulationSettings(joint_sensors=JointSensorSettings(bias_rad=0, wrist_bias_rad=0)))
    joints = {"FFJ3": 3700.0, "MFJ0": 2300.0, "THJ5": -2550.0}
    gains = np.zeros(20)
    for joint, gain in joints.items():
        gains[MOTORS.numbers[joint]] = abs(gain)
    direction = MOTORS.from_joints @ np.zeros(24)
    for joint, gain in joints.items():
        direction[MOTORS.numbers[joint]] = np.sign(gain)
    start = MOTORS.from_joints @ program.joints_rad()
    transport, errors, forces = program.start_forces("FF"), [], []
    demand = np.zeros(20, int)
    for cycle in range(220):
        target = start + direction * 0.5 * np.clip(0.01 * cycle, 0, 1)
        answer = program.ask(to_motor_data_type=ToMotor.DEMAND_PWM, motor_data=demand)
        measured = MOTORS.from_joints @ program.world.calibration.joints.angles_rad(decode_palm(answer.payload).sensors)
        demand = np.clip(np.rint(gains * (target - measured)), -600, 600).astype(int)
        program.wait()
        errors.append((target - MOTORS.from_joints @ program.plant.joints_rad)[gains > 0])
        forces.append(records(transport.receive())["counts"][-1] / 1e6)
    assert np.degrees(np.abs(errors[90:100])).max() < 3.0  # lag of the ramp
    assert np.degrees(np.abs(np.mean(errors[-60:], axis=0))).max() < 0.3
    assert np.degrees(np.std(errors[-60:], axis=0)).max() < 0.06
    assert np.std(np.array(forces)[-60:, :3], axis=0).max() < 0.006
