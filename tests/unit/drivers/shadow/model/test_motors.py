from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.shadow.model.gains import GainTable, JointGains
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINTS, JOINT_LIMITS_rad
from drivers.shadow.model.motors import DRIVEN_JOINTS, MotorMap

MOTORS = MotorMap.load()


def test_the_shipped_map_is_shadows_third_right_hand_map(lab_data: Path) -> None:
    lines = (lab_data / "shadow_motor_maps" / "rh_E_v3.yaml").read_text().splitlines()
    published = {
        line.split("#")[1].strip(): int(line.split(",")[0]) for line in lines if ",  " in line or "#WRJ2" in line
    }
    driven = {name: number for name, number in published.items() if number >= 0}
    assert dict(MotorMap.load().numbers) == driven


def test_the_map_takes_joint_angles_to_motor_angles() -> None:
    joints_rad: Array = np.arange(24) / 10.0
    by_motor = dict(zip(MOTORS.names, MOTORS.from_joints @ joints_rad, strict=True))
    assert by_motor["FFJ0"] == pytest.approx(joints_rad[JOINT_INDEX["FFJ1"]] + joints_rad[JOINT_INDEX["FFJ2"]])
    assert by_motor["THJ2"] == pytest.approx(joints_rad[JOINT_INDEX["THJ2"]])
    assert set(MOTORS.names) == set(DRIVEN_JOINTS)
    assert len(JOINTS) - 4 == len(DRIVEN_JOINTS)
    np.testing.assert_allclose(MOTORS.limits_rad[MOTORS.numbers["WRJ2"]], JOINT_LIMITS_rad[JOINT_INDEX["WRJ2"]])


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"FFJ3": 0}, "must be among 0 to 19, each once"),
        ({"FFJ3": 20}, "must be among 0 to 19, each once"),
        ({"FFJ1": 1}, "unknown driven joints FFJ1"),
    ],
)
def test_a_map_that_is_not_one_to_one_is_refused(change: dict[str, int], problem: str) -> None:
    with pytest.raises(ConfigurationError, match=problem):
        MotorMap({**MOTORS.numbers, **change})


def test_a_map_without_one_of_the_motors_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "motors.yaml"
    path.write_text("motors: {FFJ0: 0}\n")
    with pytest.raises(ConfigurationError, match=r"motors.yaml: no motor for FFJ3, FFJ4"):
        MotorMap.load(path)
    with pytest.raises(ConfigurationError, match="unknown driven joints FFJ9"):
        MotorMap(MOTORS.numbers, ("FFJ9",))


def test_a_map_of_muscles_is_told_as_such(tmp_path: Path) -> None:
    path = tmp_path / "rh_muscle_v1.yaml"
    path.write_text("joint_to_muscle_mapping: [[[0, 6], [3, 0]]]\n")
    with pytest.raises(ConfigurationError, match=r"rh_muscle_v1.yaml: is the map of a hand with muscles"):
        MotorMap.load(path)


def test_gains_go_by_class_with_exceptions_by_name() -> None:
    gains = GainTable(exceptions={"THJ4": JointGains(pwm_per_rad=1.0)})
    assert gains.of("THJ4").pwm_per_rad == 1.0
    classes = {name: gains.of(name) for name in ("FFJ0", "MFJ3", "RFJ4", "LFJ5", "THJ3", "WRJ2")}
    assert list(classes.values()) == [
        gains.coupled, gains.flexion, gains.spread, gains.spread, gains.thumb, gains.wrist,
    ]  # fmt: skip
