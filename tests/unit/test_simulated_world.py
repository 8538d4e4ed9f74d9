"""The simulated rig as its links show it: device bytes, timing, repeatability, and the truth channel."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gtsam import Pose2, Pose3, Rot3

from drivers.ati import rdt_codec
from drivers.biotac.electrodes import electrode_layout
from drivers.biotac.estimator import contact_from_electrodes
from drivers.biotac.slot_codec import decode_slot, electrode_channel
from drivers.links import Datagram, Link
from drivers.positioner_codec import PositionerCommand, decode_status, encode_command
from drivers.positioner_kinematics import mount_T_forearm
from drivers.shadow import palm_codec
from drivers.shadow.kinematics import JOINT_INDEX, JOINTS, JOINT_LIMITS_rad, forearm_T_palm, palm_T_distal_matrices
from drivers.shadow.motor_data import FromMotor, MotorFlag, ToMotor, config_upload
from drivers.shadow.motors import DRIVEN_JOINTS, MotorMap, angles_of_driven
from drivers.shadow.palm_codec import EdcCommand, PalmCommand, PalmStatus
from drivers.shadow.palm_codec import decode_status as decode_palm
from drivers.simulation.biotac_emulator import BiotacSkin
from drivers.simulation.calibration import SimulatedCalibration
from drivers.simulation.geared_motors import DISTAL_COUPLING, motor_class
from drivers.simulation.model import build_model
from drivers.simulation.objects import CATALOGUE, object_model
from drivers.simulation.plant import START_BASE, Plant, TrueContact
from drivers.simulation.rdt_emulator import RESOLUTION
from drivers.simulation.settings import (
    BiotacSettings,
    ForceSensorSettings,
    JointSensorSettings,
    ObjectStart,
    SimulationSettings,
)
from drivers.simulation.world import SimulatedWorld
from tactile_lab.errors import CodecError, ConfigurationError
from tactile_lab.geometry.contacts import FINGERS

MS = 1_000_000
CYCLE_ns = 10 * MS
PERFECT_JOINTS = JointSensorSettings(bias_rad=0, wrist_bias_rad=0, noise_rad=0)
PERFECT_FORCES = ForceSensorSettings(offset_N=0, offset_Nm=0, drift_N=0, drift_Nm=0, noise_lsb=0)
PERFECT = SimulationSettings(joint_sensors=PERFECT_JOINTS, force_sensors=PERFECT_FORCES)
MOTORS = MotorMap.load()


class Program:
    """The host's side, no cleverer than a test needs."""

    def __init__(self, settings: SimulationSettings = PERFECT, seed: int = 0) -> None:
        self.world = SimulatedWorld(settings, seed)
        self.links: dict[str, Link] = self.world.links()
        for link in self.links.values():
            link.open()
        self.sequence = 0
        self.plant = self.world._plant  # what no program can see

    def wait(self, duration_ns: int = CYCLE_ns) -> None:
        self.world.clock.sleep_until_ns(self.world.clock.now_ns() + duration_ns)

    def ask(self, **changes: Any) -> Datagram:
        """One command to the palm; gives what came back with it."""
        command = PalmCommand(**{"edc_command": EdcCommand.SENSOR_DATA, **changes})
        self.links["hand"].send(palm_codec.encode_command(command))
        (datagram,) = self.links["hand"].receive()
        return datagram

    def status(self, **changes: Any) -> PalmStatus:
        """The status that answers a command: it comes back with the next one."""
        self.ask(**changes)
        return decode_palm(self.ask(**changes).payload)

    def drive(self, duty: dict[str, int], cycles: int) -> PalmStatus:
        """PWM demands for a number of cycles, others zero."""
        words = np.zeros(20, int)
        for joint, value in duty.items():
            words[MOTORS.numbers[joint]] = value
        for _ in range(cycles):
            answer = self.ask(to_motor_data_type=ToMotor.DEMAND_PWM, motor_data=words)
            self.wait()
        return decode_palm(answer.payload)

    def move_base(self, q: np.ndarray, cycles: int = 60) -> np.ndarray:
        for _ in range(cycles):
            self.sequence += 1
            self.links["base"].send(encode_command(PositionerCommand(self.sequence, q)))
            self.wait()
        return decode_status(self.links["base"].receive()[-1].payload).q

    def joints_rad(self) -> np.ndarray:
        return self.world.calibration.joints.angles_rad(self.status().sensors)

    def start_forces(self, finger: str = "FF") -> Link:
        link = self.links[f"ft/{finger}"]
        link.send(rdt_codec.encode_request(rdt_codec.Command.START))
        return link


def records(datagrams: list[Datagram]) -> np.ndarray:
    return np.concatenate([rdt_codec.decode_records(datagram.payload) for datagram in datagrams])


# --- the model -------------------------------------------------------------------------------------------------------


def test_fingertips_of_the_model_follow_the_kinematics() -> None:
    calibration = SimulatedCalibration.packaged()
    tips = {finger: calibration.tip_body(finger, "nano17") for finger in FINGERS}
    mount = Pose3(Rot3.Ypr(0.3, -0.1, 0.2), np.array([0.02, -0.03, 0.05]))
    plant = Plant(build_model(object_model("cube-6"), 0.3, tips, mount), Pose2())
    rng = np.random.default_rng(5)
    low, high = JOINT_LIMITS_rad.T
    for joints_rad in low + (high - low) * rng.random((20, 24)):
        plant.pose_hand(joints_rad)
        expected = palm_T_distal_matrices(joints_rad)
        world_T_palm = plant.world_T_palm
        for row, finger in enumerate(FINGERS):
            found = world_T_palm.between(plant.world_T_distal(finger)).matrix()
            np.testing.assert_allclose(found, expected[row], atol=1e-6)


def test_palm_follows_positioner_mount_and_wrist() -> None:
    calibration = SimulatedCalibration.packaged()
    tips = {finger: calibration.tip_body(finger, "nano17") for finger in FINGERS}
    mount = Pose3(Rot3.Ypr(0.3, -0.1, 0.2), np.array([0.02, -0.03, 0.05]))
    plant = Plant(build_model(object_model("cube-6"), 0.3, tips, mount), Pose2())
    joints_rad = np.where(np.char.startswith(JOINTS, "WR"), -0.2, 0.1)
    plant.pose_hand(joints_rad)
    expected = mount * mount_T_forearm(START_BASE) * forearm_T_palm(joints_rad)
    np.testing.assert_allclose(plant.world_T_palm.matrix(), expected.matrix(), atol=1e-6)


# --- one seed, one world ---------------------------------------------------------------------------------------------

TRAFFIC = """
import hashlib, sys
sys.path.insert(0, {folder!r})
from test_simulated_world import traffic
print(traffic({seed}))
"""


def traffic(seed: int, cycles: int = 30) -> str:
    """Digest of everything the devices sent while the hand moved for a while."""
    program = Program(SimulationSettings(), seed)
    digest = hashlib.sha256()
    for finger in FINGERS:
        program.start_forces(finger)
    for cycle in range(cycles):
        duty = np.full(20, 100 if cycle % 20 < 10 else -60)
        digest.update(program.ask(to_motor_data_type=2, motor_data=duty, from_motor_data_type=5).payload)
        program.links["base"].send(encode_command(PositionerCommand(cycle + 1, START_BASE - 0.002 * cycle)))
        program.wait()
        for name in sorted(program.links):
            for datagram in program.links[name].receive():
                digest.update(datagram.payload + datagram.stamp_ns.to_bytes(8, "little"))
    program.links["camera"].send(b"TRIGGER")
    digest.update(program.links["camera"].receive()[0].payload)
    return digest.hexdigest()


def test_same_seed_and_commands_give_the_same_bytes() -> None:
    assert traffic(7) == traffic(7)


def test_another_seed_gives_other_bytes() -> None:
    assert traffic(7) != traffic(8)


def test_another_process_gives_the_same_bytes() -> None:
    script = TRAFFIC.format(folder=str(__file__).rsplit("/", 1)[0], seed=7)
    other = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=120)
    assert other.stdout.strip() == traffic(7)


def test_object_starts_near_the_middle_at_any_turn() -> None:
    starts = [SimulatedWorld(SimulationSettings(), seed).truth().world_T_object for seed in range(6)]
    assert all(np.hypot(pose.x(), pose.y()) < 0.045 for pose in starts)
    assert np.ptp([pose.rotation().yaw() for pose in starts]) > 2.0


def test_object_starts_where_it_is_told() -> None:
    settings = SimulationSettings(object="l-block", start=ObjectStart(x_m=0.03, y_m=-0.02, yaw_rad=0.5))
    pose = SimulatedWorld(settings, 0).truth().world_T_object
    np.testing.assert_allclose(pose.matrix(), Pose3(Rot3.Yaw(0.5), np.array([0.03, -0.02, 0.025])).matrix(), atol=1e-9)


@pytest.mark.parametrize("name", CATALOGUE)
def test_untouched_object_stays_where_it_lies(name: str) -> None:
    world = SimulatedWorld(SimulationSettings(object=name), 1)
    before = world.truth().world_T_object
    world.clock.sleep_until_ns(1000 * MS)
    moved = before.between(world.truth().world_T_object)
    assert np.linalg.norm(moved.translation()) < 2e-4
    assert np.linalg.norm(Rot3.Logmap(moved.rotation())) < 2e-3


def test_scanned_object_stands_still_from_the_beginning(lab_data: Path) -> None:
    world = SimulatedWorld(SimulationSettings(object=f"mesh:{lab_data / 'ycb_meshes' / 'ycb_tomato_soup_can.ply'}"), 1)
    before = world.truth().world_T_object
    world.clock.sleep_until_ns(500 * MS)
    moved = before.between(world.truth().world_T_object)
    assert before.rotation().matrix()[2, 2] > np.cos(np.radians(1))
    assert np.linalg.norm(moved.translation()) < 2e-4
    assert np.linalg.norm(Rot3.Logmap(moved.rotation())) < 2e-3


# --- time ------------------------------------------------------------------------------------------------------------


def test_devices_never_stamp_ahead_of_the_clock() -> None:
    program = Program()
    link = program.start_forces()
    for duration_ns in (3 * MS, 7 * MS, 13 * MS + 1, 1, 29 * MS):
        program.wait(duration_ns)
        stamps = [datagram.stamp_ns for datagram in link.receive()] + [program.ask().stamp_ns]
        assert max(stamps) <= program.world.clock.now_ns()
        assert program.world.clock.now_ns() - stamps[-1] < 2 * MS


def test_waiting_in_small_steps_or_at_once_is_the_same_world() -> None:
    slow, quick = Program(seed=3), Program(seed=3)
    for program in (slow, quick):
        program.start_forces("TH")
        program.ask(to_motor_data_type=ToMotor.DEMAND_PWM, motor_data=np.full(20, 200))
    for _ in range(50):
        slow.wait(1 * MS)
    quick.wait(50 * MS)
    assert slow.links["ft/TH"].receive() == quick.links["ft/TH"].receive()
    assert slow.ask().payload == quick.ask().payload


# --- the palm --------------------------------------------------------------------------------------------------------


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
        Program().links["hand"].send(bytes(69))


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
    assert status.not_fitted == tuple(range(26, 32))
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
        program.links["hand"].send(palm_codec.encode_command(PalmCommand(edc_command=EdcCommand.SENSOR_DATA)))
        assert program.links["hand"].receive() == []
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
    link, errors, forces = program.start_forces("FF"), [], []
    demand = np.zeros(20, int)
    for cycle in range(220):
        target = start + direction * 0.5 * np.clip(0.01 * cycle, 0, 1)
        answer = program.ask(to_motor_data_type=ToMotor.DEMAND_PWM, motor_data=demand)
        measured = MOTORS.from_joints @ program.world.calibration.joints.angles_rad(decode_palm(answer.payload).sensors)
        demand = np.clip(np.rint(gains * (target - measured)), -600, 600).astype(int)
        program.wait()
        errors.append((target - MOTORS.from_joints @ program.plant.joints_rad)[gains > 0])
        forces.append(records(link.receive())["counts"][-1] / 1e6)
    assert np.degrees(np.abs(errors[90:100])).max() < 3.0  # lag of the ramp
    assert np.degrees(np.abs(np.mean(errors[-60:], axis=0))).max() < 0.3
    assert np.degrees(np.std(errors[-60:], axis=0)).max() < 0.06
    assert np.std(np.array(forces)[-60:, :3], axis=0).max() < 0.006


# --- the positioner --------------------------------------------------------------------------------------------------


def test_positioner_goes_to_its_target_and_says_where_it_is() -> None:
    target = START_BASE + np.array([0.05, -0.03, 0.04, 0.3, 0.2, -0.1])
    np.testing.assert_allclose(Program().move_base(target), target, atol=5e-4)


def test_question_to_the_positioner_moves_nothing() -> None:
    program = Program()
    program.links["base"].send(encode_command(PositionerCommand(0, None)))
    np.testing.assert_allclose(decode_status(program.links["base"].receive()[0].payload).q, START_BASE, atol=1e-9)
    program.wait(200 * MS)
    program.links["base"].send(encode_command(PositionerCommand(0, None)))
    np.testing.assert_allclose(decode_status(program.links["base"].receive()[0].payload).q, START_BASE, atol=1e-3)


# --- force sensors ---------------------------------------------------------------------------------------------------


def test_force_records_come_at_their_rate_with_both_sequences() -> None:
    program = Program()
    link = program.start_forces()
    program.wait(200 * MS)
    datagrams = link.receive()
    found = records(datagrams)
    assert list(found["rdt_sequence"]) == list(range(1, 21))
    assert set(np.diff(found["ft_sequence"].astype(int))) == {70}
    assert {b.stamp_ns - a.stamp_ns for a, b in pairwise(datagrams)} == {CYCLE_ns}
    assert not found["status"].any()


def test_no_records_before_a_start_and_after_a_stop() -> None:
    program = Program()
    program.wait(50 * MS)
    assert program.links["ft/MF"].receive() == []
    link = program.start_forces("MF")
    program.wait(50 * MS)
    assert len(link.receive()) == 5
    link.send(rdt_codec.encode_request(rdt_codec.Command.STOP))
    program.wait(50 * MS)
    assert link.receive() == []


def test_a_wanted_number_of_records_is_sent() -> None:
    program = Program()
    program.links["ft/LF"].send(rdt_codec.encode_request(rdt_codec.Command.START, 3))
    program.wait(100 * MS)
    assert len(program.links["ft/LF"].receive()) == 3


def test_untouched_sensor_feels_the_weight_of_its_tip() -> None:
    program = Program()
    link = program.start_forces("RF")
    program.drive({}, 40)
    wrench = records(link.receive())["counts"][-1] / 1e6
    tip = program.world.calibration.fingertips["RF"]
    pose = program.plant.world_T_distal("RF") * tip.distal_T_sensor.pose()
    weight = pose.rotation().matrix().T @ [0, 0, -tip.mass_kg * 9.81]
    arm = tip.distal_T_sensor.pose().transformTo(np.array(tip.com_distal_m))
    np.testing.assert_allclose(wrench, np.r_[weight, np.cross(arm, weight)], atol=1.2 * RESOLUTION.max())


def test_readings_are_steps_of_the_sensors_resolution() -> None:
    program = Program(SimulationSettings())
    link = program.start_forces("TH")
    program.wait(300 * MS)
    steps = records(link.receive())["counts"] / 1e6 / RESOLUTION
    np.testing.assert_allclose(steps, np.rint(steps), atol=0.04)  # counts are whole millionths
    assert 0.4 < np.std(steps, axis=0).mean() < 2.5


def test_software_bias_zeroes_the_box_and_wants_a_new_start() -> None:
    program = Program(SimulationSettings(), seed=2)
    link = program.start_forces()
    program.wait(30 * MS)
    before = records(link.receive())["counts"][-1] / 1e6
    link.send(rdt_codec.encode_request(rdt_codec.Command.SET_SOFTWARE_BIAS))
    program.wait(30 * MS)
    assert link.receive() == []
    program.start_forces()
    program.wait(30 * MS)
    after = records(link.receive())["counts"][-1] / 1e6
    assert np.abs(before[:3]).max() > 0.1
    assert np.abs(after[:3]).max() < 0.05


def pressing_on_the_table(program: Program) -> Iterator[None]:
    """Lower the hand, fingers pointing down, until a fingertip stands on the table and beyond."""
    upright = np.array([0.0, 0.25, 0.48, 0.0, np.pi / 2, 0.0])
    program.move_base(upright, 120)
    for height in np.arange(0.48, 0.35, -0.001):
        program.move_base(np.array([*upright[:2], height, *upright[3:]]), 2)
        program.drive({}, 1)
        yield


def test_truth_and_sensor_agree_when_a_fingertip_stands_on_the_table() -> None:
    program = Program()
    link = program.start_forces("MF")
    program.drive({}, 30)
    for _ in pressing_on_the_table(program):
        if "MF" in program.world.truth().fingers_on_table:
            break
    program.drive({}, 10)
    truth = program.world.truth()
    assert "MF" in truth.fingers_on_table
    assert truth.contacts == ()
    force_N = np.linalg.norm(records(link.receive())["counts"][-1, :3] / 1e6)
    true_N = sum(
        np.linalg.norm(contact.force_on_tip_world_N) for contact in program.plant.contacts() if contact.finger == "MF"
    )
    assert true_N > 0.05
    assert force_N == pytest.approx(true_N, abs=0.1)


def test_overloaded_sensor_says_saturated() -> None:
    settings = PERFECT.model_copy(update={"force_sensors": PERFECT_FORCES.model_copy(update={"offset_N": 1e4})})
    program = Program(settings)
    link = program.start_forces()
    program.wait(20 * MS)
    record = records(link.receive())[-1]
    assert rdt_codec.describe_status(int(record["status"])).messages == ("sensor saturated or disconnected",)
    assert abs(record["counts"][2]) == 17_000_000


# --- BioTacs ---------------------------------------------------------------------------------------------------------

BIOTAC = SimulationSettings(fingertips="biotac")


def test_biotac_rig_has_no_force_links_and_speaks_its_protocol() -> None:
    program = Program(BIOTAC)
    assert set(program.links) == {"hand", "base", "camera"}
    protocol = program.status(tactile_data_type=0xFFF9)
    assert protocol.tactile_valid == 0b11111
    assert int.from_bytes(protocol.tactile[0, :2].tobytes(), "little") == 2
    assert program.status(tactile_data_type=0xFFFC).tactile[3].tobytes().startswith(b"BTSIM")


def test_biotac_slots_answer_the_request_of_the_command_before() -> None:
    program = Program(BIOTAC)
    program.ask(tactile_data_type=1)
    status = decode_palm(program.ask(tactile_data_type=electrode_channel(19)).payload)
    slot = decode_slot(status.tactile[0].tobytes(), status.tactile_data_type)
    assert set(slot.values) == {1, 2}
    assert 1600 < slot.values[1] < 2900
    assert len(slot.vibration) == 2
    last = decode_palm(program.ask().payload)
    assert set(decode_slot(last.tactile[4].tobytes(), last.tactile_data_type).values) == {electrode_channel(19)}


def pressed_skin(force_N: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors of point (m) and normal (rad) of equation 2.24, and the pressure's rise, over places on the pad."""
    calibration = SimulatedCalibration.packaged().biotacs["FF"]
    skin = BiotacSkin(calibration, BiotacSettings(), np.random.default_rng(0))
    assert calibration.skin is not None
    surface = calibration.skin.surface()
    layout = electrode_layout(19, surface)
    rng = np.random.default_rng(1)
    places = np.column_stack([rng.uniform(-6, 6, 40), rng.uniform(-4, 4, 40), np.full(40, -8.0)]) * 1e-3
    points, normals = surface.project(places)
    rest = skin.channels(Pose3(), [])
    point_errors, angles, rises = [], [], []
    mounting = calibration.distal_T_sensor.pose()
    for point, normal in zip(points, normals, strict=True):
        into_tip = -(mounting.rotation().matrix() @ normal)
        touch = TrueContact("FF", "object", mounting.transformFrom(point), into_tip, force_N * into_tip)
        change = skin.channels(Pose3(), [touch]) - rest
        found = contact_from_electrodes(change[None, 3:], layout, noise_counts=15.0)
        point_errors.append(np.linalg.norm(found.points_m[0] - point))
        angles.append(np.arccos(np.clip(found.normals[0] @ normal, -1, 1)))
        rises.append(change[0])
    return np.array(point_errors), np.array(angles), np.array(rises)


def test_pressed_biotac_tells_where_it_is_pressed() -> None:
    point_errors, angles, _ = pressed_skin(0.5)
    assert np.median(point_errors) < 0.0025
    assert np.degrees(np.median(angles)) < 15


def test_biotac_pressure_rises_with_force_until_the_skin_rests_on_the_core() -> None:
    assert np.median(pressed_skin(0.5)[2]) == pytest.approx(100, rel=0.1)
    assert np.median(pressed_skin(4.0)[2]) == pytest.approx(400, rel=0.1)


def test_biotac_without_an_ellipsoid_skin_is_refused() -> None:
    packaged = SimulatedCalibration.packaged()
    bare = packaged.biotacs["FF"].model_copy(update={"skin": None})
    changed = SimulatedCalibration(**{**vars(packaged), "biotacs": {**packaged.biotacs, "MF": bare}})
    with pytest.raises(ConfigurationError, match="BioTac of MF has no ellipsoid skin"):
        SimulatedWorld(BIOTAC, 0, changed)


def test_missing_fingertip_calibration_is_refused() -> None:
    packaged = SimulatedCalibration.packaged()
    changed = SimulatedCalibration(**{**vars(packaged), "fingertips": {"FF": packaged.fingertips["FF"]}})
    with pytest.raises(ConfigurationError, match="no nano17 calibration for MF"):
        SimulatedWorld(PERFECT, 0, changed)


# --- camera ----------------------------------------------------------------------------------------------------------


def test_each_trigger_gives_one_picture() -> None:
    program = Program()
    camera = program.links["camera"]
    assert camera.receive() == []
    camera.send(b"TRIGGER")
    program.wait()
    (picture,) = camera.receive()
    assert picture.payload.startswith(b"\xff\xd8")
    assert picture.stamp_ns == 0
    assert camera.receive() == []


def test_camera_refuses_what_is_no_trigger() -> None:
    with pytest.raises(CodecError, match="no trigger"):
        Program().links["camera"].send(b"SNAP")
