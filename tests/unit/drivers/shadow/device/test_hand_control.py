"""Torque demands, demands by joint, the published gains, damping and integral, and motors reset when connecting."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from pydantic import ValidationError

from drivers.core.clock import VirtualClock
from drivers.core.errors import ConfigurationError, DeviceError
from drivers.core.transports import MemoryTransport
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.hand_setup import HandSetup
from drivers.shadow.device.position_control import PositionControl
from drivers.shadow.model.gains import GainTable, JointGains, load_gains
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.kinematics import JOINT_INDEX, joint_vector
from drivers.shadow.model.motors import DRIVEN_JOINTS, MotorMap
from drivers.shadow.protocol.motor_data import CONFIG_TYPES, MAX_PWM, MotorFlag, ToMotor, config_crc
from drivers.shadow.protocol.palm_codec import PalmCommand
from drivers.simulation.devices.motor_bank import GAUGE_COUNTS_PER_Nm, MotorBank
from tactile_lab import rigs
from tests.support.fake_palm import FakePalm

SIMULATED = Path(rigs.__file__).parent / "calibrations" / "simulated-hand"
MOTORS = MotorMap.load()
CYCLE_ns = 10_000_000


def hand(settings: HandSettings, motors: MotorMap = MOTORS) -> tuple[ShadowHand, FakePalm, VirtualClock]:
    clock = VirtualClock()
    palm = FakePalm(clock, motors)
    joints = JointCalibration.load(SIMULATED / "joints.yaml")
    return ShadowHand(MemoryTransport("hand", palm), clock, joints, settings, motors), palm, clock


def run(device: ShadowHand, clock: VirtualClock, cycles: int) -> None:
    for _ in range(cycles):
        device.exchange()
        clock.sleep_until_ns(clock.now_ns() + CYCLE_ns)


# --- demands -------------------------------------------------------------------------------------------------------


def test_a_hand_of_torque_demands_sends_torques_alone() -> None:
    gains = GainTable(exceptions={"FFJ3": JointGains(pwm_per_rad=20_000.0, max_pwm=4000.0)})
    device, palm, clock = hand(HandSettings(demand="torque", gains=gains, soft_start_s=0.0))
    device.connect()
    device.set_targets({"FFJ3": 1.2})
    run(device, clock, 2)
    assert {command.to_motor_data_type for command in palm.commands[1:]} == {ToMotor.DEMAND_TORQUE}
    assert palm.pwm[MOTORS.numbers["FFJ3"]] == 4000  # more than a duty cycle could be
    device.close()
    assert not any(palm.pwm)


def test_demands_of_joints_take_the_place_of_their_position_control_until_a_target_comes() -> None:
    device, palm, clock = hand(HandSettings(soft_start_s=0.0), motors=MOTORS.reverse(("MFJ3",)))
    device.connect()
    device.set_targets({"FFJ3": 1.2})
    device.set_demands({"FFJ3": -80.0, "MFJ3": 120.0, "RFJ3": 5000.0})
    run(device, clock, 1)
    assert palm.pwm[MOTORS.numbers["FFJ3"]] == -80
    assert palm.pwm[MOTORS.numbers["MFJ3"]] == -120  # its motor turns backwards
    assert palm.pwm[MOTORS.numbers["RFJ3"]] == 600  # the joint's largest
    assert device.targets_rad == {}
    device.set_targets({"FFJ3": 1.2})
    run(device, clock, 1)
    assert palm.pwm[MOTORS.numbers["FFJ3"]] == 600
    device.stop()
    run(device, clock, 1)
    assert not any(palm.pwm)
    device.close()


def test_demands_rise_gently_and_are_refused_when_they_are_none() -> None:
    device, palm, clock = hand(HandSettings(soft_start_s=0.5))
    device.connect()
    device.set_demands({"FFJ3": 600.0})
    run(device, clock, 1)
    assert palm.pwm[MOTORS.numbers["FFJ3"]] == 0
    run(device, clock, 26)
    assert 250 < palm.pwm[MOTORS.numbers["FFJ3"]] < 350
    for wrong in ({"FFJ1": 1.0}, {"FFJ3": float("nan")}):
        with pytest.raises(DeviceError):
            device.set_demands(wrong)
    device.close()


def test_a_duty_cycle_beyond_the_full_one_is_no_setting() -> None:
    gains = GainTable(wrist=JointGains(pwm_per_rad=1.0, max_pwm=2000.0))
    HandSettings(demand="torque", gains=gains)
    with pytest.raises(ValidationError, match="2000 counts is more than the maximum, 1023"):
        HandSettings(gains=gains)


# --- gains ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("serial", ["378", "554"])
def test_published_gains_are_read_with_their_signs(serial: str, lab_data: Path) -> None:
    path = lab_data / "shadow_hand_config" / serial / "sr_edc_joint_position_controllers_PWM.yaml"
    published = load_gains(path)
    content = yaml.safe_load(path.read_text())
    for entry in content.values():
        joint = entry["joint"].removeprefix("rh_")
        gains = published.table.of(joint)
        assert gains.pwm_per_rad == abs(entry["pid"]["p"])
        assert gains.damping == abs(entry["pid"]["d"])
        assert gains.max_pwm == entry["pid"]["max_force"]
        assert (joint in published.backwards) == (entry["pid"]["p"] < 0)


_USUAL = {"p": 4500.0, "i": 0.0, "d": 50.0, "i_clamp": 0.0, "max_force": 600.0, "position_deadband": 0.003}


def published(**changes: dict[str, float]) -> dict[str, dict[str, object]]:
    """A file like Shadow's for all joints, with changes by joint."""
    return {
        f"sh_rh_{joint.lower()}_position_controller": {
            "joint": f"rh_{joint}",
            "pid": _USUAL | changes.get(joint, {}),
            "type": "sr_mechanism_controllers/SrhJointPositionController",
        }
        for joint in DRIVEN_JOINTS
    }


def write(tmp_path: Path, content: object) -> Path:
    path = tmp_path / "gains.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ([1], "no position controllers"),
        ({"a": {"joint": "rh_FFJ0"}}, "pid"),
        (dict(list(published().items())[1:]), "missing or unknown: FFJ0"),
        (published() | {"again": published()["sh_rh_ffj0_position_controller"]}, "named twice"),
        (published(FFJ3={"p": 100.0, "d": -50.0}), "of FFJ3 have different signs"),
        (published(FFJ3={"p": 0.0}), "have different signs"),
        (published(FFJ3={"max_force": -1.0}), "max_force"),
        (
            published() | {"sh_rh_ffj0_position_controller": {"joint": "lh_FFJ0", "pid": _USUAL}},
            "of a left and of a right hand",
        ),
    ],
)
def test_a_file_of_gains_that_can_not_be_used_is_refused(content: object, words: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=words):
        load_gains(write(tmp_path, content))


def test_a_setup_drives_the_hand_with_the_file_it_names(tmp_path: Path) -> None:
    path = write(tmp_path, published(MFJ3={"p": -1000.0, "d": -10.0, "max_force": 77.0}))
    setup = HandSetup.model_validate(
        {
            "ethercat": {"interface": "hand0"},
            "hand": {},
            "joints": SIMULATED / "joints.yaml",
            "motors": SIMULATED / "motors.yaml",
            "gains": path,
        }
    )
    assert setup.settings().gains.of("MFJ3").max_pwm == 77.0
    assert setup.motor_map().sign[MOTORS.numbers["MFJ3"]] == -1
    assert setup.motor_map().sign[MOTORS.numbers["FFJ3"]] == 1


def test_damping_works_against_the_speed_and_forgets_it_after_a_pause() -> None:
    control = PositionControl(MOTORS, GainTable(exceptions={"FFJ3": JointGains(pwm_per_rad=1000.0, damping=100.0)}))
    control.set_targets({"FFJ3": 1.0})
    motor, joints, now_ns = MOTORS.numbers["FFJ3"], joint_vector({"FFJ3": 0.8}), 0
    still = int(control.demand(joints, 1.0, now_ns)[motor])
    for _ in range(100):
        now_ns += 2_000_000
        joints[JOINT_INDEX["FFJ3"]] += 0.0004  # 0.2 rad/s towards the target
        moving = int(control.demand(joints, 1.0, now_ns)[motor])
    angle = joints[JOINT_INDEX["FFJ3"]]
    assert moving == pytest.approx(1000.0 * (1.0 - angle - 0.003) - 100.0 * 0.2, abs=2)
    assert still == 197
    assert control.demand(joints, 1.0, now_ns + 1_000_000_000)[motor] == round(1000.0 * (1.0 - angle - 0.003))


def test_the_integral_grows_to_its_clamp() -> None:
    gains = JointGains(pwm_per_rad=1000.0, integral=500.0, integral_max=40.0, deadband_rad=0.0)
    control = PositionControl(MOTORS, GainTable(exceptions={"FFJ3": gains}))
    control.set_targets({"FFJ3": 0.5})
    motor, joints = MOTORS.numbers["FFJ3"], joint_vector({"FFJ3": 0.4})
    demands = [int(control.demand(joints, 1.0, step * 10_000_000)[motor]) for step in range(200)]
    assert demands[0] == 100
    assert demands[20] == pytest.approx(110, abs=1)
    assert demands[-1] == 140


# --- motor boards --------------------------------------------------------------------------------------------------


def test_motors_are_reset_first_when_the_settings_say_so() -> None:
    device, palm, _ = hand(HandSettings(reset_motors=True, reset_wait_s=0.2))
    device.connect()
    kinds = [command.to_motor_data_type for command in palm.commands]
    first = kinds.index(ToMotor.RESET)
    assert kinds.count(ToMotor.RESET) == 1
    assert kinds[first + 1 : first + 21] == [ToMotor.SYSTEM_CONTROLS] * 20
    assert list(palm.commands[first].motor_data) == [0x5200 | motor % 10 for motor in range(20)]
    device.close()


class Plant:
    """Motors that push against something: the torque is a share of what they could give."""

    def __init__(self) -> None:
        self.stamp_ns = 0
        self.duty = np.zeros(20)

    @property
    def joints_rad(self) -> np.ndarray:
        return np.zeros(24)

    @property
    def motor_torque_Nm(self) -> np.ndarray:
        from drivers.simulation.devices.geared_motors import motor_class

        return np.asarray(self.duty * np.array([motor_class(joint).stall_Nm for joint in DRIVEN_JOINTS]))

    def drive(self, duty: np.ndarray) -> None:
        self.duty = np.asarray(duty)


def test_emulated_motors_hold_a_torque_within_their_limit() -> None:
    plant = Plant()
    bank = MotorBank(plant, MOTORS, np.random.default_rng(0))
    motor = MOTORS.numbers["FFJ3"]
    words = np.zeros(20, np.int16)
    words[motor] = 300
    for _ in range(10):
        bank.take(PalmCommand(to_motor_data_type=ToMotor.DEMAND_TORQUE, motor_data=words))
    row = DRIVEN_JOINTS.index("FFJ3")
    assert plant.motor_torque_Nm[row] * GAUGE_COUNTS_PER_Nm == pytest.approx(300, rel=0.1)
    assert not bank.answer(4)[1][motor] & MotorFlag.NO_DEMAND
    config = [100, 64, MAX_PWM, 0, 300, 4500, 0, 0, 0, 5]
    for kind, word in zip(CONFIG_TYPES, config, strict=True):
        alone = np.zeros(20, np.int16)
        alone[motor] = word
        bank.take(PalmCommand(to_motor_data_type=kind, motor_data=alone))
    check = np.zeros(20, np.uint16)
    check[motor] = config_crc(config)
    bank.take(PalmCommand(to_motor_data_type=ToMotor.CONFIG_CRC, motor_data=check.view(np.int16)))
    for _ in range(10):
        bank.take(PalmCommand(to_motor_data_type=ToMotor.DEMAND_TORQUE, motor_data=words))
    assert plant.motor_torque_Nm[row] * GAUGE_COUNTS_PER_Nm == pytest.approx(100, rel=0.1)
