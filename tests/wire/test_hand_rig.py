"""A rig file of kind ``hand``: what ``rig check`` says of an emulated hand, and of what is wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from drivers.core.contacts import FINGERS
from drivers.core.errors import ConfigurationError
from drivers.emulators.ethercat.server import EmulatedHandProcess
from drivers.emulators.ethercat.shadow_chain import ChainSettings
from tactile_lab.rigs.checks.check import check_rig
from tactile_lab.rigs.emulate import emulated_hand
from tactile_lab.rigs.hand_rig import load_hand_rig
from tests.support.ethercat_wire import JOINTS, cable
from tests.support.hand_folders import FOLDERS, FULL_RIGHT, fix_joints, write_folder

pytestmark = pytest.mark.usefixtures("real_time_alone")

CALIBRATIONS = ("calibration joints", "calibration motors")


def rig_file(folder: Path, interface: str, **changes: Any) -> Path:
    content = {
        "name": "bench-hand",
        "summary": "The hand on the bench",
        "kind": "hand",
        "calibration": {"joints": str(JOINTS), "motors": str(JOINTS.with_name("motors.yaml"))},
        "ethercat": {"interface": interface, "master": {"answer_s": 0.05, "setup_answer_s": 0.1}},
    }
    file = folder / "hand.yaml"
    file.write_text(yaml.safe_dump(content | changes))
    return file


def test_a_sound_hand_is_told_part_by_part(tmp_path: Path) -> None:
    with cable("r") as (near, far):
        file = rig_file(tmp_path, near, far_end=far, hand={"tactile": "biotac"})
        with emulated_hand(load_hand_rig(file)) as places:
            assert places == {"hand": f"hand 634 at {far}"}
            findings = {finding.device: finding for finding in check_rig(str(file))}
    tips = [findings.pop(f"fingertip {finger}") for finger in FINGERS]
    assert set(findings) == {*CALIBRATIONS, "ring", "cycle", "motors", "joint sensors"}
    assert tips[1].detail.startswith("BioTac, SynTouch, serial BTSIM-MF, software 2.3, board 1.0, 100 Hz; core ")
    assert findings["ring"].detail == "hand 634, palm 0220 revision 1, in operation, no watchdog"
    assert "20 of 20 answer, warmest" in findings["motors"].detail
    assert "supply 24.0 V, firmware revision 1200" in findings["motors"].detail
    assert findings["joint sensors"].ok
    assert "750 cycles, " in findings["cycle"].detail


def test_a_motor_map_is_checked_by_moving_when_asked(tmp_path: Path) -> None:
    content = yaml.safe_load(JOINTS.with_name("motors.yaml").read_text())
    motors = content["motors"]
    motors["FFJ3"], motors["MFJ3"] = motors["MFJ3"], motors["FFJ3"]
    wrong = tmp_path / "motors.yaml"
    wrong.write_text(yaml.safe_dump(content))
    with cable("r") as (near, far), EmulatedHandProcess(far, JOINTS):
        file = rig_file(tmp_path, near, calibration={"joints": str(JOINTS), "motors": str(wrong)})
        findings = {finding.device: finding for finding in check_rig(str(file), move=True)}
    assert not findings["motor map"].ok
    assert "moves MFJ3, but the motor map says FFJ3" in findings["motor map"].detail


def test_a_lite_hand_is_emulated_by_its_own_folder_and_moves_motor_by_motor(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "4711", next(kind for kind in FOLDERS if kind.name == "rh_extra_lite_v1"))
    files = {"joints": str(folder.joints), "motors": str(folder.motors), "gains": str(folder.gains)}
    with cable("r") as (near, far):
        file = rig_file(tmp_path, near, far_end=far, hand={"palm": "0250"}, calibration=files)
        with emulated_hand(load_hand_rig(file)):
            findings = {finding.device: finding for finding in check_rig(str(file), move=True)}
    assert findings["ring"].detail.startswith("hand 4711, palm 0250 revision 1, in operation")
    assert "10 of 10 answer" in findings["motors"].detail
    assert findings["joint sensors"].detail == "all 13 within their range"
    assert findings["motor map"].detail == "each of 10 motors moves its own joint"


def test_fixed_joints_and_motors_that_are_not_to_be_driven_are_left_alone_and_told(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "554", FULL_RIGHT)
    fix_joints(folder)
    files = {"joints": str(folder.joints), "motors": str(folder.motors), "gains": str(folder.gains)}
    with cable("r") as (near, far):
        file = rig_file(tmp_path, near, far_end=far, calibration=files)
        with emulated_hand(load_hand_rig(file)):
            findings = {finding.device: finding for finding in check_rig(str(file), move=True)}
    assert findings["joint sensors"].detail == "all 21 within their range"
    assert findings["motors"].ok
    words = "each of 18 motors moves its own joint; not to be driven: LFJ0, THJ1"
    assert (findings["motor map"].ok, findings["motor map"].detail) == (True, words)


def test_a_simulated_rig_has_no_motors_to_nudge() -> None:
    with pytest.raises(ConfigurationError, match="sim: has no real motors to move"):
        check_rig("sim", move=True)


def test_a_silent_motor_is_named(tmp_path: Path) -> None:
    with cable("r") as (near, far), EmulatedHandProcess(far, JOINTS) as emulator:
        emulator.order(silent=[5])
        findings = {finding.device: finding for finding in check_rig(str(rig_file(tmp_path, near)))}
    assert not findings["motors"].ok
    assert "THJ2 (motor 5): silent" in findings["motors"].detail


def test_the_palm_is_found_by_its_product_code_and_one_that_is_stated_is_verified(tmp_path: Path) -> None:
    with cable("r") as (near, far), EmulatedHandProcess(far, JOINTS, ChainSettings(palm="0230")):
        _, _, ring, _, motors, _ = check_rig(str(rig_file(tmp_path, near)))
        *_, refusal = check_rig(str(rig_file(tmp_path, near, hand={"palm": "0220"})))
    assert ring.detail.startswith("hand 634, palm 0230 revision 1, in operation")
    assert "20 of 20 answer" in motors.detail
    assert not refusal.ok
    assert 'a 0230 palm, not a 0220. Set hand.palm to "0230"' in refusal.detail


def test_a_missing_interface_is_told(tmp_path: Path) -> None:
    *_, finding = check_rig(str(rig_file(tmp_path, "nosuch0")))
    assert "nosuch0: no such network interface" in finding.detail


def test_files_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    with (
        pytest.raises(ConfigurationError, match="far_end is missing"),
        emulated_hand(load_hand_rig(rig_file(tmp_path, "lo"))),
    ):
        pass
    with pytest.raises(ConfigurationError, match=r"hand.palm and the cable's palm differ"):
        check_rig(str(rig_file(tmp_path, "lo", ethercat={"interface": "lo", "palm": "0230"}, hand={"palm": "0220"})))
    missing = {"joints": "none.yaml", "motors": "none.yaml"}
    with pytest.raises(ConfigurationError, match=r"none.yaml"):
        check_rig(str(rig_file(tmp_path, "lo", calibration=missing)))
