"""Calibrations of the hand itself as a person meets them: joints, force fingertips, electrodes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from calibration.store.store import read_record
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.kinematics import JOINT_INDEX, joint_vector
from tactile_lab.rigs.description import load_rig

RIG = load_rig("sim")


def files(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


# --- joints --------------------------------------------------------------------------------------------------------


def poses(path: Path, measured: dict[float, float], **changes: object) -> Path:
    """A table of poses of FFJ3: known angle to measured one."""
    entries = [{"known_deg": {"FFJ3": known}, "measured_deg": {"FFJ3": angle}} for known, angle in measured.items()]
    path.write_text(
        yaml.safe_dump({"format": "tactile-joint-poses/1", "rig": "simulated-hand", "poses": entries, **changes})
    )
    return path


def test_joints_are_corrected_from_a_recorded_table_and_the_file_is_used(inside, tmp_path):
    source = poses(tmp_path / "poses.yaml", {0.0: 1.1, 45.0: 46.0, 90.0: 91.2})
    out = tmp_path / "joints.yaml"
    answer = inside("calibrate", "joints", "--from", source, "--out", out, "--no-input", "--json")
    assert answer.code == 0, answer.err
    document = json.loads(answer.out)
    assert (document["verdict"], document["method"]) == ("PASS", "known poses")
    assert document["details"]["FFJ3"]["poses"] == 3
    before, after = JointCalibration.load(RIG.files["joints"]), JointCalibration.load(out)
    counts = before.raw_counts(joint_vector({"FFJ3": 0.7}))
    change = np.degrees(after.angles_rad(counts) - before.angles_rad(counts))[JOINT_INDEX["FFJ3"]]
    assert change == pytest.approx(-1.1, abs=0.1)
    again = inside("calibrate", "joints", "--from", source, "--out", out, "--no-input")
    assert (again.code, "exists already" in again.err) == (2, True)


def test_poses_without_measured_angles_are_read_from_the_hand(inside, tmp_path):
    entries = [{"name": "on the plate", "known_deg": {"FFJ3": 0.0, "MFJ3": 0.0}}] * 2
    (tmp_path / "jig.yaml").write_text(
        yaml.safe_dump({"format": "tactile-joint-poses/1", "rig": "simulated-hand", "poses": entries})
    )
    out, kept = tmp_path / "joints.yaml", tmp_path / "read.yaml"
    answer = inside(
        "calibrate", "joints", "--from", tmp_path / "jig.yaml", "--record", kept, "--out", out, "--no-input"
    )
    assert answer.code == 0, answer.err
    assert "hold the hand on the plate (FFJ3 0, MFJ3 0 deg): done" in answer.err
    read = [pose["measured_deg"] for pose in yaml.safe_load(kept.read_text())["poses"]]
    details = read_record(out).details
    for joint in ("FFJ3", "MFJ3"):
        first, second = (pose[joint] for pose in read)
        assert 0.05 < abs(first) < 4.0  # nobody holds the simulated hand: it sinks a little from flat
        assert details[joint]["shift_deg"] == pytest.approx(-(first + second) / 2, abs=1e-6)


@pytest.mark.parametrize(
    ("measured", "words"),
    [({0.0: 1.0}, "1 pose, 2 needed"), ({0.0: 3.0, 10.0: 7.0, 15.0: 18.0}, "deg, limit 1.00")],
)
def test_joints_outside_their_limits_end_with_3_and_replace_nothing(inside, tmp_path, measured, words):
    source = poses(tmp_path / "poses.yaml", measured)
    out = tmp_path / "joints.yaml"
    answer = inside("calibrate", "joints", "--from", source, "--out", out, "--no-input")
    assert answer.code == 3
    assert words in " ".join(answer.out.split())
    assert files(tmp_path) == ["joints.failed.yaml", "poses.yaml"]
    assert read_record(tmp_path / "joints.failed.yaml").verdict == "FAIL"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rig": "another"}, "was recorded on rig another"),
        ({"poses": []}, "poses"),
        ({"poses": [{"known_deg": {"XXJ3": 0.0}, "measured_deg": {"XXJ3": 1.0}}]}, "unknown joints XXJ3"),
        ({"poses": [{"known_deg": {"FFJ3": 0.0}, "measured_deg": {"FFJ3": 40.0}}]}, "the correction of FFJ3 is -40.0"),
        ({"colour": "red"}, "colour: unknown key"),
    ],
)
def test_tables_of_joints_that_can_not_be_used_are_named(inside, tmp_path, changes, words):
    source = poses(tmp_path / "poses.yaml", {0.0: 1.0, 30.0: 31.0}, **changes)
    answer = inside("calibrate", "joints", "--from", source, "--out", tmp_path / "joints.yaml", "--no-input")
    assert (answer.code, words in answer.err) == (2, True), answer.err
    assert files(tmp_path) == ["poses.yaml"]


# --- electrodes ----------------------------------------------------------------------------------------------------


def counts(path: Path, change: dict[int, float] | None = None) -> Path:
    table = 2000.0 + np.round(4.0 * np.random.default_rng(0).standard_normal((200, 19)))
    for index, value in (change or {}).items():
        table[:, index] = value
    np.savetxt(path, table, fmt="%d", delimiter=",")
    return path


def test_sound_electrodes_are_told_with_their_tare(inside, tmp_path):
    answer = inside("calibrate", "electrodes", "--from", counts(tmp_path / "counts.csv"), "--json")
    assert answer.code == 0, answer.err
    document = json.loads(answer.out)
    assert document["faults"] == {}
    np.testing.assert_allclose(document["tare"], 2000.0, atol=2.0)


def test_dead_and_open_electrodes_are_named_with_exit_code_3(inside, tmp_path):
    answer = inside("calibrate", "electrodes", "--from", counts(tmp_path / "counts.csv", {3: 1800.0, 7: 4095.0}))
    assert answer.code == 3
    assert "never changes: dead" in answer.out
    assert "at the end of its range" in answer.out
    assert "2 faulty" in answer.out


@pytest.mark.parametrize(
    ("text", "words"), [("a,b\n", "is not a table of counts"), ("1,2\n3,4\n", "2 samples, 20 needed")]
)
def test_tables_of_counts_that_can_not_be_used_are_named(inside, tmp_path, text, words):
    path = tmp_path / "counts.csv"
    path.write_text(text)
    answer = inside("calibrate", "electrodes", "--from", path)
    assert (answer.code, words in answer.err) == (2, True)


# --- force fingertips ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "told"),
    [(("--finger", "TH"), "TH cannot be stretched on its own"), (("--rig", "sim-biotac"), "has no force fingertips")],
)
def test_fingertips_that_can_not_be_measured_are_refused(inside, tmp_path, words, told):
    answer = inside("calibrate", "fingertip", *words, "--out", tmp_path / "tips.yaml", "--no-input")
    assert (answer.code, told in answer.err) == (2, True), answer.err
    assert files(tmp_path) == []
