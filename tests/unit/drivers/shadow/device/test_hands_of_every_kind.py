"""Hands of every published kind: loaded from a folder in Shadow's form, on the emulated ring, motor by motor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from drivers.core.errors import ConfigurationError, DeviceError
from tests.support.emulated_hands import EmulatedBench, setup_of
from tests.support.hand_family import DEFECTS, family, write_hand
from tests.support.hand_folders import FOLDERS, FULL_RIGHT, HandFolder, write_folder

LITE = next(kind for kind in FOLDERS if kind.name == "rh_lite_v1")


QUICK = ("rh_E_v4", "lh_E_v5", "rh_extra_lite_v1")
KINDS = [pytest.param(kind, id=kind.name, marks=[] if kind.name in QUICK else pytest.mark.long) for kind in FOLDERS]


@pytest.mark.parametrize("kind", KINDS)
def test_every_motor_that_a_hand_has_moves_its_own_joint(tmp_path: Path, kind: HandFolder) -> None:
    findings = EmulatedBench(setup_of(write_folder(tmp_path, kind))).moves()
    assert {finding.joint for finding in findings} == set(kind.numbers)
    assert all(finding.ok for finding in findings)


@pytest.mark.parametrize("palm", ["0230", *(pytest.param(palm, marks=pytest.mark.long) for palm in ("0240", "0250"))])
def test_other_palms_drive_the_same_motors(tmp_path: Path, palm: str) -> None:
    kind = HandFolder(LITE.name, LITE.numbers, palm=palm, backwards=("FFJ3", "THJ4"))  # type: ignore[arg-type]
    assert all(finding.ok for finding in EmulatedBench(setup_of(write_folder(tmp_path, kind))).moves())


def test_a_joint_that_a_hand_does_not_have_has_no_target_and_stays_at_zero(tmp_path: Path) -> None:
    bench = EmulatedBench(setup_of(write_folder(tmp_path, LITE)))
    bench.hand.connect()
    sample = bench.cycle()
    assert not sample.joints_rad[~bench.setup.calibration().has_joint].any()
    assert np.isnan(sample.motor.torque[~bench.motors.is_fitted]).all()
    with pytest.raises(DeviceError, match="no motor drives LFJ3"):
        bench.hand.set_targets({"LFJ3": 0.1})
    bench.hand.close()


def test_the_folder_of_another_serial_number_is_refused_before_anything_moves(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "378", FULL_RIGHT)
    with pytest.raises(ConfigurationError, match="names hand 554, but its files are those of hand 378"):
        setup_of(folder, serial=554).check_files()
    with pytest.raises(DeviceError, match="hand 634, not hand 378"):
        EmulatedBench(setup_of(folder)).hand.connect()


@pytest.mark.parametrize(
    ("file", "change", "words"),
    [
        ("joints", ("FFJ3", "FFJ33"), r"calibration.yaml: misses FFJ3 and has unknown FFJ33"),
        ("joints", ("sr_calibrations:", "sr_calibratons:"), r"calibration.yaml: .*sr_calibratons"),
        ("gains", ("rh_MFJ4", "rh_MFJ9"), r"PWM.yaml: missing or unknown: MFJ4, MFJ9"),
        ("gains", ("max_force: 500.0", "max_force: nan"), r"PWM.yaml, .*max_force"),
        ("joints", ("- 2487", "- 24870"), r"calibration.yaml: the table of \w+ has 24870 counts; its sensor reads 0"),
        ("joints", ("- 90\n", "- 900\n"), r"calibration.yaml: the table of \w+ has 900 degrees; no joint turns"),
        ("gains", ("max_force: 500.0", "max_force: 5000.0"), r"PWM.yaml: max_force of FFJ0 is 5000, but the largest"),
        (
            "gains",
            ("position_deadband: 0.003", "position_deadband: 3"),
            r"PWM.yaml, .*: pid.position_deadband: .* not 3",
        ),
        ("info", ("- ff\n", "- fff\n"), r"general_info.yaml: names a finger that there is not: FFF. Fingers are FF"),
        (
            "motors",
            ("- 13", "- 25"),
            r"the motor numbers must be among 0 to 19, each once, not MFJ4 25\.",
        ),
        (
            "motors",
            ("- 13", "- 11"),
            r"the motor numbers must be among 0 to 19, each once, not \w+ 11, \w+ 11\.",
        ),
        ("motors", ("- 17", "- -1"), r"rh_E_v3.yaml: no motor for RFJ4"),
    ],
)
def test_a_typing_error_in_a_file_is_named(tmp_path: Path, file: str, change: tuple[str, str], words: str) -> None:
    folder = write_folder(tmp_path, FULL_RIGHT)
    place: Path = getattr(folder, file)
    place.write_text(place.read_text().replace(*change, 1))
    with pytest.raises(ConfigurationError, match=words):
        setup_of(folder).check_files()


def test_a_table_of_gains_of_the_other_side_is_refused_before_motors_turn_the_wrong_way(tmp_path: Path) -> None:
    left = next(kind for kind in FOLDERS if kind.name == "lh_E_v3")
    folder, other = write_folder(tmp_path / "hand", left), write_folder(tmp_path / "other", FULL_RIGHT)
    folder.gains.write_text(other.gains.read_text())
    words = r"_PWM\.yaml: is of a right hand, and the hand is a left one: .*\. Name the table of the connected hand"
    with pytest.raises(ConfigurationError, match=words):
        setup_of(folder).check_files()


def test_the_family_has_the_published_proportions() -> None:
    hands = family()
    assert len(hands) == 121
    assert sum(hand.kind.side == "left" and len(hand.kind.fingers) == 5 for hand in hands) == 25
    assert sum(len(hand.kind.fingers) < 5 for hand in hands) == 24
    assert sum(bool(hand.defect) for hand in hands) == 10


@pytest.mark.parametrize("defect", DEFECTS)
def test_a_defect_of_a_calibration_is_named_with_its_file(tmp_path: Path, defect: str) -> None:
    """All 121 hands: ``python -m tests.support.hand_family_table``."""
    hand = next(hand for hand in family() if hand.defect == defect)
    with pytest.raises(ConfigurationError, match=rf"{hand.serial}/calibrations/calibration\.yaml.*J\d"):
        setup_of(write_hand(tmp_path, hand)).check_files()
