"""What happens before a real hand may move: polling rates, settings of the motor boards, the check of its motor map."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.core.clock import VirtualClock
from drivers.core.errors import ConfigurationError, DeviceError
from drivers.emulators.ethercat.shadow_chain import emulated_hand
from drivers.shadow.device.first_move import FirstMoveSettings, check_motor_map, require_motor_map
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_samples import HandSample
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.motor_polling import MotorPolling, PollingRates, load_rates
from drivers.shadow.ethercat.hand_transport import EthercatSettings, EthercatTransport
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.motors import DRIVEN_JOINTS, MotorMap
from drivers.shadow.protocol.motor_configuration import MotorConfiguration, TorqueLoop, load_configurations
from drivers.shadow.protocol.motor_data import FromMotor, SlowData, config_crc
from tactile_lab import rigs
from tests.support.memory_port import MemoryPort

CALIBRATION = JointCalibration.load(Path(rigs.__file__).parent / "calibrations" / "simulated-hand" / "joints.yaml")
TRUE_MAP = MotorMap.load()
CONFIG = "shadow_hand_config/378/motor_board_effort_controllers.yaml"


class Rig:
    """The emulated hand on its ring; the program may be wrong about its motor map."""

    def __init__(self, believed: MotorMap = TRUE_MAP, boards: Any = None, **settings: Any) -> None:
        self.clock = VirtualClock()
        self.emulated = emulated_hand(self.clock, CALIBRATION)
        self.bank = self.emulated.palm.motors
        transport = EthercatTransport(
            "hand", EthercatSettings(interface="m"), self.clock, MemoryPort(self.emulated.ring)
        )
        self.hand = ShadowHand(
            transport, self.clock, CALIBRATION, HandSettings(cycle_s=0.001, **settings), believed, boards
        )

    def cycle(self) -> HandSample:
        self.clock.sleep_until_ns(self.clock.now_ns() + 1_000_000)
        return self.hand.exchange()

    def cycles(self, count: int) -> HandSample:
        for _ in range(count):
            sample = self.cycle()
        return sample


def board(**changes: Any) -> MotorConfiguration:
    words = {"torque_limit": 500, "torque_limiter_gain": 64, "max_pwm": 600, "sgleftref": 0, "sgrightref": 0}
    gains = {"f": 300, "p": 4500, "i": 0, "d": 0, "imax": 0, "deadband": 5, "sign": 0}
    return MotorConfiguration(pid=TorqueLoop(**(words | gains | changes)), backlash_compensation=True)


BOARDS = {joint: board() for joint in DRIVEN_JOINTS}


# --- polling ------------------------------------------------------------------------------------------------------


def test_published_rates_are_read(lab_data: Path) -> None:
    rates = load_rates(lab_data / "shadow_hand_config" / "378" / "motor_data_polling.yaml")
    assert set(rates.always) == {FromMotor(code) for code in (1, 2, 3, 4, 5)}
    assert rates.periods_s[FromMotor.CAN_ERRORS] == 0.1
    assert rates.at_first.count(FromMotor.SLOW_MISC) == len(SlowData) - 1


def test_types_asked_once_come_in_every_second_turn_and_then_no_more() -> None:
    polling = MotorPolling(PollingRates(slow_data=-2.0, pterm=-2.0, temperature=5.0, voltage=None))
    asked = [polling.next(0)[1] for _ in range(200)]
    assert asked.count(FromMotor.SLOW_MISC) == 32
    assert asked.count(FromMotor.P_TERM) == 2
    assert FromMotor.SLOW_MISC not in asked[80:]
    assert FromMotor.FLAGS in asked[:12]


def test_slow_data_of_all_motors_are_gathered_by_their_type() -> None:
    rig = Rig(polling=PollingRates(slow_data=-2.0))
    rig.hand.connect()
    slow = rig.cycles(160).motor.slow
    assert (slow[SlowData.GEAR_RATIO] == 131).all()
    assert (slow[SlowData.MONTH_DAY] == 0x0A1F).all()
    rig.hand.close()


@pytest.mark.parametrize(
    ("rates", "words"),
    [
        ({"flags": -2.0}, "requested periodically"),
        ({"flags": 3.0}, "requested periodically"),
        ({"pwm": 0.0}, "a rate must be -1, -2 or a period"),
        ({"current": -7.0}, "a rate must be -1, -2 or a period"),
    ],
)
def test_rates_without_meaning_are_refused(rates: dict[str, float], words: str, tmp_path: Path) -> None:
    file = tmp_path / "rates.yaml"
    file.write_text(f"motor_data_update_rate: {json.dumps(rates)}")
    with pytest.raises(ConfigurationError, match=words):
        load_rates(file)


# --- settings of the motor boards ---------------------------------------------------------------------------------


def test_published_board_settings_give_the_published_checksums(lab_data: Path) -> None:
    golden = json.loads((lab_data / "golden_vectors.json").read_text())["motor_config_crc"]
    boards = load_configurations(lab_data / CONFIG)
    assert {joint.lower(): list(each.pid.words) for joint, each in boards.items()} == {
        joint: entry["words_5_to_E"] for joint, entry in golden.items()
    }
    assert all(config_crc(boards[joint.upper()].pid.words) == int(entry["crc"], 16) for joint, entry in golden.items())


def test_every_motor_takes_its_settings_before_anything_can_move() -> None:
    boards = BOARDS | {"FFJ3": board(max_pwm=321)}
    boards["WRJ1"] = boards["WRJ1"].model_copy(update={"backlash_compensation": False})
    rig = Rig(boards=boards)
    rig.hand.connect()
    rig.cycles(5)
    assert rig.bank._max_pwm[TRUE_MAP.numbers["FFJ3"]] == 321
    assert np.count_nonzero(rig.bank._max_pwm == 600) == 19
    assert rig.bank.backlash_compensated.tolist().count(False) == 1
    assert not rig.bank.backlash_compensated[TRUE_MAP.numbers["WRJ1"]]
    assert rig.hand.health() == () or "lost" in rig.hand.health()[0]
    rig.hand.close()


def test_lost_cycles_do_not_damage_an_upload() -> None:
    rig = Rig(boards=BOARDS)
    rig.emulated.ring.faults.drop_share = 0.03
    rig.hand.connect()
    assert (rig.bank._max_pwm == 600).all()
    rig.hand.close()


def test_a_motor_that_refuses_its_settings_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "drivers.simulation.devices.motor_bank.config_crc", lambda words: 1 if words[2] == 321 else 0x1068
    )
    rig = Rig(boards=BOARDS | {"FFJ3": board(max_pwm=321)})
    with pytest.raises(DeviceError, match=r"hand, FFJ3 \(motor 1\): last configuration failed its checksum"):
        rig.hand.connect()


def test_a_file_that_lacks_a_motor_or_holds_nonsense_is_refused(tmp_path: Path, lab_data: Path) -> None:
    text = (lab_data / CONFIG).read_text()
    file = tmp_path / "boards.yaml"
    file.write_text(text.replace("wrj2:", "wrj9:"))
    with pytest.raises(ConfigurationError, match="missing or unknown: WRJ2, WRJ9"):
        load_configurations(file)
    file.write_text(text.replace("max_pwm: 600", "max_pwm: 1600", 1))
    with pytest.raises(ConfigurationError, match="max_pwm"):
        load_configurations(file)
    file.write_text("- 1")
    with pytest.raises(ConfigurationError, match="contains no motors"):
        load_configurations(file)


# --- the map of the motors ----------------------------------------------------------------------------------------


def swapped(first: str, second: str) -> MotorMap:
    numbers = dict(TRUE_MAP.numbers)
    numbers[first], numbers[second] = numbers[second], numbers[first]
    return MotorMap(numbers)


def test_shadows_own_map_files_are_read(lab_data: Path) -> None:
    read = MotorMap.load(lab_data / "shadow_motor_maps" / "rh_E_v3.yaml")
    assert read.numbers == TRUE_MAP.numbers
    lite = MotorMap.load(lab_data / "shadow_motor_maps" / "rh_lite_v1.yaml")
    assert (len(lite.driven), lite.stated_side, int(lite.is_fitted.sum())) == (13, None, 13)


def test_a_right_map_is_confirmed_motor_by_motor_and_the_joints_come_back() -> None:
    rig = Rig()
    rig.hand.connect()
    before = rig.emulated.plant.joints_rad
    findings = check_motor_map(rig.hand, TRUE_MAP, rig.cycle, rig.clock)
    assert [finding.joint for finding in findings] == list(DRIVEN_JOINTS)
    assert all(finding.ok for finding in findings)
    assert np.abs(rig.emulated.plant.joints_rad - before).max() < 0.02
    require_motor_map(findings, "hand")
    rig.hand.close()


def test_the_first_contradiction_ends_the_check_and_is_named() -> None:
    believed = swapped("MFJ0", "THJ2")
    rig = Rig(believed)
    rig.hand.connect()
    before = rig.emulated.plant.joints_rad
    findings = check_motor_map(rig.hand, believed, rig.cycle, rig.clock)
    assert [finding.ok for finding in findings] == [True, True, True, False]
    assert np.degrees(np.abs(rig.emulated.plant.joints_rad - before)).max() < 4.0
    with pytest.raises(DeviceError, match="motor 5 moves THJ2, but the motor map says MFJ0"):
        require_motor_map(findings, "hand")
    rig.hand.close()


def test_a_motor_that_turns_the_wrong_way_is_named() -> None:
    believed = MotorMap(TRUE_MAP.numbers, ("FFJ3",))
    rig = Rig(believed)
    rig.hand.connect()
    findings = check_motor_map(rig.hand, believed, rig.cycle, rig.clock, ("FFJ3",))
    assert "the wrong way: list it under reversed" in str(findings[-1])
    rig.hand.close()


def test_a_motor_at_its_joints_limit_is_tried_the_other_way_and_a_dead_one_given_up() -> None:
    rig = Rig()
    rig.hand.connect()
    rig.emulated.plant._angles_rad[2] = np.pi / 2
    rig.cycles(1)
    assert check_motor_map(rig.hand, TRUE_MAP, rig.cycle, rig.clock, ("FFJ3",))[0].ok
    rig.bank._max_pwm[:] = 0
    findings = check_motor_map(rig.hand, TRUE_MAP, rig.cycle, rig.clock, ("FFJ3",), FirstMoveSettings(patience_s=0.02))
    assert str(findings[0]) == "motor 1 moves nothing; the motor map says FFJ3"
    rig.hand.close()


@pytest.mark.parametrize(("joint", "pwm"), [("FFJ1", 10.0), ("FFJ3", 400.0), ("FFJ3", float("nan"))])
def test_a_nudge_is_small_and_of_a_driven_joint(joint: str, pwm: float) -> None:
    rig = Rig()
    with pytest.raises(DeviceError, match="cannot nudge"):
        rig.hand.nudge(joint, pwm)


def test_a_palm_that_hangs_takes_the_demands_away_and_then_stops_the_hand() -> None:
    rig = Rig(soft_start_s=0.0, link_patience_s=0.05, blind_after=2)
    rig.hand.connect()
    rig.hand.set_targets({"FFJ3": 1.5})
    rig.cycles(5)
    rig.emulated.palm.hung = True
    with pytest.raises(DeviceError, match=r"stopped: no valid status for 0\.05 s"):
        rig.cycles(60)
    rig.clock.sleep_until_ns(rig.clock.now_ns() + 20_000_000)  # a motor that hears nothing halts itself
    turned = rig.emulated.plant.joints_rad[2]
    rig.clock.sleep_until_ns(rig.clock.now_ns() + 50_000_000)
    assert rig.emulated.plant.joints_rad[2] == turned
    rig.hand.close()
