"""``tactile-lab session slips``: what a rig file's ``motion`` should say, by the camera."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

from tactile_lab.evaluation.slips import Slips
from tactile_lab.slam.tracking.contacts.motion import MotionNoise


def test_slips_of_recorded_sessions_are_told_and_too_few_say_so(inside, recorded_root, recorded):
    answer = inside("session", "slips", "--root", recorded_root)
    assert answer.code == 0
    assert "Slips in 1 session (" in answer.out
    assert "left in place" in answer.out
    assert "at least 10 are needed" in answer.err
    document = json.loads(inside("session", "slips", recorded.name, "--root", recorded_root, "--json").out)
    assert document["sessions"] == [recorded.name]
    assert document["motion"] is None
    steps = document["carried"] + document["left"]
    assert len(steps) == 1
    assert all(abs(x_m) < 0.03 and abs(y_m) < 0.03 for x_m, y_m, _ in steps)


def test_the_motion_is_printed_as_the_rig_file_wants_it(inside, recorded_root, recorded, monkeypatch):
    rng = np.random.default_rng(3)
    slips = Slips(rng.normal(size=(40, 3)) * [0.006, 0.006, 0.15], rng.normal(size=(40, 3)) * [0.0006, 0.0006, 0.01])
    monkeypatch.setattr("tactile_lab.workflow.measuring_slips.session_slips", lambda session: slips)
    said = inside("session", "slips", recorded.name, "--root", recorded_root).out
    assert "pushed by the closing hand although left in place: 0 of 40" in said
    motion = MotionNoise.model_validate(yaml.safe_load(said.split("for the rig file:")[1])["motion"])
    assert motion.translation_m == pytest.approx(0.006, rel=0.2)
    assert motion.unheld == pytest.approx(0.1, rel=0.3)


def test_sessions_of_several_rigs_are_not_mixed(inside, recorded, tmp_path):
    for name, rig in (("one", "sim"), ("other", "another-rig")):
        copy = tmp_path / name
        shutil.copytree(recorded, copy)
        manifest = copy / "session.yaml"
        manifest.write_text(manifest.read_text().replace("rig: sim\n", f"rig: {rig}\n"))
    answer = inside("session", "slips", "--root", tmp_path)
    assert answer.code != 0
    assert "sessions of several rigs: another-rig, sim" in answer.err


def test_a_folder_without_sessions_says_what_to_do(inside, tmp_path: Path):
    answer = inside("session", "slips", "--root", tmp_path)
    assert answer.code != 0
    assert "tactile-lab run" in answer.err


def test_a_session_without_its_markers_says_which_file_is_missing(inside, recorded, tmp_path):
    copy = tmp_path / "blind"
    shutil.copytree(recorded, copy)
    (copy / "calibration" / "markers.yaml").unlink()
    answer = inside("session", "slips", "blind", "--root", tmp_path)
    assert answer.code != 0
    assert "markers.yaml" in answer.err


def test_sessions_whose_camera_saw_nothing_show_no_slip(inside, recorded_root, monkeypatch):
    monkeypatch.setattr("tactile_lab.workflow.measuring_slips.session_slips", lambda session: Slips.between([], []))
    answer = inside("session", "slips", "--root", recorded_root)
    assert answer.code != 0
    assert "slips cannot be measured in any of the sessions" in answer.err
    assert "marker camera that sees the object at two grasps in a row" in answer.err
