from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
import yaml
from gtsam import Pose3, Rot3

from calibration.forearm.placement import ForearmCalibration, load_forearm
from calibration.store.admission import Installation, admit, objections
from calibration.store.store import CalibrationRecord, new_record, read_record, target_file, write_record
from drivers.camera.calibration import load_camera
from drivers.core.errors import ConfigurationError, WriteError
from drivers.core.fingertip import load_fingertips
from tactile_lab.rigs.description import load_rig, shipped_rigs

NOW = datetime(2026, 11, 21, 9, 0, tzinfo=UTC)
POSE = Pose3(Rot3.Ypr(0.3, -0.2, 0.1), np.array([0.1, -0.2, 0.3]))
HERE = Installation("lab", {"hand": "378"})


def record(**changes) -> CalibrationRecord:
    made = new_record(
        "forearm",
        rig="lab",
        method="touch",
        parameters=ForearmCalibration.of(POSE, np.diag([1e-6] * 3 + [1e-8] * 3)),
        verdict="PASS",
        devices={"hand": "378"},
        residuals={"rms_mm": 0.7, "per_pose_mm": [0.1, 1e-7, 3.0]},
        notes="1e3 looks like a number\nand this is a second line",
        now=NOW,
    )
    return made.model_copy(update=changes)


@pytest.fixture
def stored(tmp_path: Path) -> Path:
    path = tmp_path / "forearm.yaml"
    write_record(path, record(), "Where the base stands.")
    return path


def test_a_record_comes_back_as_it_was_written(stored):
    assert read_record(stored) == record()
    assert stored.read_text().startswith("# Where the base stands.\n")


@pytest.mark.parametrize("notes", ["1e3", "2026-11-21", ".5", "-7", "no", "", "12:30:00", "with: a colon"])
def test_notes_that_look_like_something_else_stay_text(tmp_path, notes):
    path = tmp_path / "forearm.yaml"
    write_record(path, record(notes=notes))
    assert read_record(path).notes == notes


def test_the_device_loader_reads_the_stored_form(stored):
    forearm = load_forearm(stored)
    assert forearm.world_T_mount.pose().equals(POSE, 1e-12)
    np.testing.assert_allclose(forearm.covariance(), np.diag([1e-6] * 3 + [1e-8] * 3))


def test_comments_and_layout_may_change(stored):
    text = stored.read_text()
    stored.write_text("# another comment\n" + text.replace("verdict: PASS", "verdict:   'PASS'"))
    assert read_record(stored) == record()


@pytest.mark.parametrize(
    ("pattern", "replacement"),
    [(r"0\.3\b", "0.31"), ("verdict: PASS", "verdict: FAIL"), ("rig: lab", "rig: other"), ("sha256: .*", "sha256: aa")],
)
def test_a_file_changed_by_hand_is_refused_by_store_and_device(stored, pattern, replacement):
    changed = re.sub(pattern, replacement, stored.read_text(), count=1)
    assert changed != stored.read_text()
    stored.write_text(changed)
    for reader in (read_record, load_forearm):
        with pytest.raises(ConfigurationError, match="changed by hand"):
            reader(stored)


def test_another_version_of_the_form_is_named(stored):
    stored.write_text(stored.read_text().replace("tactile-calibration/1", "tactile-calibration/9"))
    with pytest.raises(ConfigurationError, match="tactile-calibration/9"):
        load_forearm(stored)


def test_a_plain_file_is_no_record(tmp_path):
    path = tmp_path / "forearm.yaml"
    path.write_text(yaml.safe_dump({"world_T_mount": {"translation_m": [0, 0, 0]}}))
    with pytest.raises(ConfigurationError, match="is not a stored calibration"):
        read_record(path)


def test_a_failed_result_goes_beside_the_file_and_replaces_nothing_that_passed(tmp_path):
    out = tmp_path / "forearm.yaml"
    assert target_file(out, record()) == out
    assert target_file(out, record(verdict="FAIL")) == tmp_path / "forearm.failed.yaml"


def test_a_place_that_can_not_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteError, match="--out"):
        write_record(tmp_path / "file" / "forearm.yaml", record())


def test_a_covariance_that_is_none_is_refused(stored):
    bad = -np.eye(6)
    with pytest.raises(ValueError, match="not a covariance"):
        ForearmCalibration.of(POSE, bad)


def test_a_good_calibration_is_admitted(stored):
    assert admit({"forearm": stored}, HERE, now=NOW) == ()


@pytest.mark.parametrize(
    ("changes", "here", "words"),
    [
        ({"rig": "sim"}, HERE, "belongs to rig sim, not to lab"),
        ({}, Installation("lab", {"hand": "554"}), "belongs to the hand with serial number 378, not 554"),
        ({"valid_until_utc": "2026-11-01T00:00:00+00:00"}, HERE, "is valid until 2026-11-01"),
        ({"created_utc": "2027-11-21T09:00:00+00:00"}, HERE, "was created in the future"),
        ({"verdict": "FAIL"}, HERE, "did not pass its limits"),
        ({"kind": "camera"}, HERE, "is a calibration of camera"),
    ],
)
def test_what_may_not_be_used_is_refused_with_the_reason(tmp_path, changes, here, words):
    path = tmp_path / "forearm.yaml"
    write_record(path, record(**changes))
    with pytest.raises(ConfigurationError, match=re.escape(words)) as refused:
        admit({"forearm": path}, here, now=NOW)
    assert "--allow-uncalibrated" in str(refused.value)
    (overlooked,) = admit({"forearm": path}, here, allow_uncalibrated=True, now=NOW)
    assert words in overlooked


def test_missing_plain_and_edited_files_are_objected_to(tmp_path, stored):
    plain = tmp_path / "plain.yaml"
    plain.write_text("focal_px: [1, 1]\n")
    stored.write_text(stored.read_text().replace("rig: lab", "rig: else"))
    files = {"forearm": stored, "camera": plain, "fingertips": tmp_path / "none.yaml"}
    reasons = {objection.role: objection.reason for objection in objections(files, HERE, NOW)}
    assert "changed by hand" in reasons["forearm"]
    assert "is not a stored calibration" in reasons["camera"]
    assert "file not found" in reasons["fingertips"]


def test_the_tables_of_the_maker_need_no_record(tmp_path):
    path = tmp_path / "joints.yaml"
    path.write_text("sr_calibrations: []\n")
    assert admit({"joints": path, "motors": path}, HERE, now=NOW) == ()


def test_an_expired_calibration_is_expired_at_the_stated_time_only():
    until = datetime.fromisoformat(str(record().valid_until_utc))
    assert until - NOW == timedelta(days=90)
    assert not record().is_expired(until)
    assert record().is_expired(until + timedelta(seconds=1))


@pytest.mark.parametrize("name", sorted(shipped_rigs()))
def test_the_shipped_rigs_may_begin_sessions(name):
    rig = load_rig(name)
    assert admit(rig.files, rig.installation) == ()


def test_the_shipped_calibrations_still_say_what_they_said():
    files = load_rig("sim").files
    assert load_fingertips(files["fingertips"])["TH"].mass_kg == 0.008
    assert load_camera(files["camera"]).size_px == (640, 480)
    assert not load_forearm(files["forearm"]).covariance().any()
