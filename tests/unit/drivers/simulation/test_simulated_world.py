"""The simulated rig as a whole: model, repeatability, time, positioner, camera, and the truth channel."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from gtsam import Pose2, Pose3, Rot3

from drivers.camera.packet import picture_of
from drivers.core.contacts import FINGERS
from drivers.core.errors import CodecError
from drivers.positioner.codec import PositionerCommand, decode_status, encode_command
from drivers.positioner.kinematics import mount_T_forearm
from drivers.shadow.model.kinematics import JOINTS, JOINT_LIMITS_rad, forearm_T_palm, palm_T_distal_matrices
from drivers.shadow.protocol.motor_data import ToMotor
from drivers.simulation.calibration import SimulatedCalibration
from drivers.simulation.model import build_model
from drivers.simulation.objects import CATALOGUE, object_model
from drivers.simulation.plant import START_BASE, Plant
from drivers.simulation.settings import ObjectStart, SimulationSettings
from drivers.simulation.world import SimulatedWorld
from tests.support.simulated_program import MS, Program


def test_fingertips_of_the_model_follow_the_kinematics() -> None:
    calibration = SimulatedCalibration.from_package()
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
    calibration = SimulatedCalibration.from_package()
    tips = {finger: calibration.tip_body(finger, "nano17") for finger in FINGERS}
    mount = Pose3(Rot3.Ypr(0.3, -0.1, 0.2), np.array([0.02, -0.03, 0.05]))
    plant = Plant(build_model(object_model("cube-6"), 0.3, tips, mount), Pose2())
    joints_rad = np.where(np.char.startswith(JOINTS, "WR"), -0.2, 0.1)
    plant.pose_hand(joints_rad)
    expected = mount * mount_T_forearm(START_BASE) * forearm_T_palm(joints_rad)
    np.testing.assert_allclose(plant.world_T_palm.matrix(), expected.matrix(), atol=1e-6)


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
        program.transports["base"].send(encode_command(PositionerCommand(cycle + 1, START_BASE - 0.002 * cycle)))
        program.wait()
        for name in sorted(program.transports):
            for datagram in program.transports[name].receive():
                digest.update(datagram.payload + datagram.stamp_ns.to_bytes(8, "little"))
    program.transports["camera"].send(b"TRIGGER")
    digest.update(program.transports["camera"].receive()[0].payload)
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


def test_devices_never_stamp_ahead_of_the_clock() -> None:
    program = Program()
    transport = program.start_forces()
    for duration_ns in (3 * MS, 7 * MS, 13 * MS + 1, 1, 29 * MS):
        program.wait(duration_ns)
        stamps = [datagram.stamp_ns for datagram in transport.receive()] + [program.ask().stamp_ns]
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
    assert slow.transports["ft/TH"].receive() == quick.transports["ft/TH"].receive()
    assert slow.ask().payload == quick.ask().payload


def test_positioner_goes_to_its_target_and_says_where_it_is() -> None:
    target = START_BASE + np.array([0.05, -0.03, 0.04, 0.3, 0.2, -0.1])
    np.testing.assert_allclose(Program().move_base(target), target, atol=5e-4)


def test_question_to_the_positioner_moves_nothing() -> None:
    program = Program()
    program.transports["base"].send(encode_command(PositionerCommand(0, None)))
    np.testing.assert_allclose(decode_status(program.transports["base"].receive()[0].payload).q, START_BASE, atol=1e-9)
    program.wait(200 * MS)
    program.transports["base"].send(encode_command(PositionerCommand(0, None)))
    np.testing.assert_allclose(decode_status(program.transports["base"].receive()[0].payload).q, START_BASE, atol=1e-3)


def test_each_trigger_gives_one_picture() -> None:
    program = Program()
    camera = program.transports["camera"]
    assert camera.receive() == []
    camera.send(b"TRIGGER")
    program.wait()
    (picture,) = camera.receive()
    assert picture_of(picture.payload).startswith(b"\xff\xd8")
    assert picture.stamp_ns == 0
    assert camera.receive() == []


def test_camera_refuses_what_is_no_trigger() -> None:
    with pytest.raises(CodecError, match="not a trigger"):
        Program().transports["camera"].send(b"SNAP")
