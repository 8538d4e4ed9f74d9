"""A hand whose own files say that joints are fixed, and motors not to be driven, as those of published hand 554.

Its fingertips replace the last joints, so that J1 has 20 degrees at every count and no sensor; THJ1 and LFJ0, which has
an unsound tendon, have gains of zero.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from drivers.core.errors import ConfigurationError, DeviceError
from drivers.shadow.device.hand_setup import HandSetup
from drivers.shadow.model.kinematics import JOINT_INDEX
from tests.support.emulated_hands import EmulatedBench, setup_of
from tests.support.hand_folders import FULL_RIGHT, fix_joints, write_folder

NOT_DRIVEN = {"LFJ0", "THJ1"}


@pytest.fixture
def setup(tmp_path: Path) -> HandSetup:
    folder = write_folder(tmp_path, FULL_RIGHT)
    assert set(fix_joints(folder)) == NOT_DRIVEN
    return setup_of(folder)


def still_joints(bench: EmulatedBench) -> list[float]:
    joints_rad = bench.emulated.plant.joints_rad
    return [float(joints_rad[JOINT_INDEX[joint]]) for joint in ("LFJ1", "LFJ2", "THJ1")]


def test_the_first_move_leaves_alone_what_is_not_to_be_driven(setup: HandSetup) -> None:
    bench = EmulatedBench(setup)
    before = still_joints(bench)
    findings = bench.moves()
    assert {finding.joint for finding in findings} == set(bench.motors.driven) - NOT_DRIVEN
    assert all(finding.ok for finding in findings)
    assert still_joints(bench) == before


def test_no_nudge_drives_it_either(setup: HandSetup) -> None:
    with pytest.raises(DeviceError, match="LFJ0 is not to be driven: its largest demand is 0"):
        EmulatedBench(setup).hand.nudge("LFJ0", 100.0)


def test_targets_of_all_joints_neither_move_it_nor_stop_the_hand(setup: HandSetup) -> None:
    """No demand is no stall, and the sensor of a fixed joint is not frozen, broken or out of its range."""
    bench = EmulatedBench(setup)
    before = still_joints(bench)
    bench.hand.connect()
    bench.hand.set_targets(dict.fromkeys(bench.motors.driven, 0.1) | {"FFJ0": 1.2, "FFJ3": 1.0})
    for _ in range(800):
        sample = bench.cycle()
    assert bench.hand.health() == ()
    assert sample.joints_rad[JOINT_INDEX["FFJ1"]] == pytest.approx(np.radians(20.0))
    assert sample.joints_rad[JOINT_INDEX["FFJ2"]] == pytest.approx(1.2 - np.radians(20.0), abs=0.03)
    assert still_joints(bench) == before
    bench.hand.close()


def test_a_driven_joint_whose_angle_is_never_seen_is_refused(setup: HandSetup) -> None:
    words = r"calibration.yaml: has the same angle of THJ1 at every count, but its gains drive it.*max_force"
    with pytest.raises(ConfigurationError, match=words):
        setup.model_copy(update={"gains": None}).check_files()
