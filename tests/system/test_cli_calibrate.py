"""The forearm wizard as a person meets it: in a terminal, scripted, and with bad input."""

from __future__ import annotations

import json
import re
import shutil
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
import yaml

from calibration.forearm.placement import load_forearm
from calibration.forearm.recordings import ForearmData, save_data
from calibration.forearm.touch_plan import plan_touches
from calibration.store.store import read_record, write_record
from drivers.core.configuration import load
from tactile_lab.experiments.data.calibration_data import TrueRig, touches_of
from tactile_lab.experiments.runs.calibration_runs import GEOMETRY
from tests.support.stream_table import HAND_Hz, TARGET_Hz, simulated_streams

RIGS = Path(str(resources.files("tactile_lab.rigs")))

SETTINGS = {
    "wizard": {
        "needs": {"lever_m": 0.01},
        "limits": {"held_out_mm": 20, "repeat_mm": 20, "repeat_deg": 10, "region_mm": 20, "region_deg": 10},
    },
    "measurer": {
        "travel_m_s": 0.5,
        "turn_rad_s": 2.5,
        "fingers_rad_s": 2.5,
        "press_m_s": 0.04,
        "again_m_s": 0.006,
        "settle_s": 0.15,
    },
}


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recorded touches of the simulated rig, by kinematics."""
    rng = np.random.default_rng(3)
    rig = TrueRig.draw(rng)
    touches = tuple(touches_of(plan_touches(GEOMETRY, per_patch=4), rig, rng))
    path = tmp_path_factory.mktemp("data") / "touches.json"
    save_data(path, ForearmData(rig="simulated-hand", touches=touches))
    return path


def files(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def test_recorded_poses_are_solved_and_stored_without_asking(inside, data, tmp_path):
    out = tmp_path / "forearm.yaml"
    answer = inside(
        "calibrate", "forearm", "--from", data, "--out", out, "--no-input", "--json", "--notes", "by a test"
    )
    assert answer.code == 0, answer.err
    document = json.loads(answer.out)
    assert (document["verdict"], document["method"], document["notes"]) == ("PASS", "touch", "by a test")
    assert len(document["residuals"]["poses"]) == 20
    assert read_record(out).verdict == "PASS"
    assert load_forearm(out).covariance().any()
    again = inside("calibrate", "forearm", "--from", data, "--out", out, "--no-input")
    assert (again.code, "exists already" in again.err) == (2, True)


def test_a_result_outside_its_limits_ends_with_3_and_replaces_nothing(inside, data, tmp_path):
    settings = tmp_path / "strict.yaml"
    settings.write_text(yaml.safe_dump({"wizard": {"limits": {"region_mm": 0.001}}}))
    out = tmp_path / "forearm.yaml"
    answer = inside("calibrate", "forearm", "--from", data, "--settings", settings, "--out", out, "--no-input")
    assert answer.code == 3
    assert "OUTSIDE" in answer.out
    assert files(tmp_path) == ["forearm.failed.yaml", "strict.yaml"]


def test_a_stated_pose_needs_its_uncertainty(inside, tmp_path):
    out = tmp_path / "forearm.yaml"
    words = ("calibrate", "forearm", "--method", "manual", "--translation-mm", 10, 20, 30, "--rpy-deg", 0, 0, 90)
    refused = inside(*words, "--out", out, "--no-input")
    assert (refused.code, "--sigma-mm and --sigma-deg" in refused.err) == (2, True)
    assert inside(*words, "--sigma-mm", 2, "--sigma-deg", 0.5, "--out", out, "--no-input").code == 0
    forearm = load_forearm(out)
    np.testing.assert_allclose(forearm.world_T_mount.pose().translation(), [0.01, 0.02, 0.03])
    np.testing.assert_allclose(np.sqrt(np.diag(forearm.covariance()))[3:], 0.002)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"rig": "another"}, "was recorded on rig another, not on simulated-hand"),
        ({"touches": []}, "needs either touches or views"),
        ({"colour": "red"}, "colour: unknown key"),
    ],
)
def test_recorded_poses_that_do_not_fit_are_refused(inside, data, tmp_path, change, words):
    path = tmp_path / "data.json"
    path.write_text(json.dumps({**json.loads(data.read_text()), **change}))
    answer = inside("calibrate", "forearm", "--from", path, "--out", tmp_path / "forearm.yaml", "--no-input")
    assert (answer.code, words in answer.err) == (2, True)
    assert files(tmp_path) == ["data.json"]


def test_too_little_motion_is_refused_before_anything_is_solved(inside, data, tmp_path):
    content = json.loads(data.read_text())
    path = tmp_path / "data.json"
    path.write_text(json.dumps({**content, "touches": content["touches"][:4] * 4}))
    answer = inside("calibrate", "forearm", "--from", path, "--out", tmp_path / "forearm.yaml", "--no-input")
    assert answer.code == 2
    assert "the motion is not enough" in answer.err
    assert "too few touches determine the position along" in answer.err
    assert files(tmp_path) == ["data.json"]


def test_without_anybody_to_ask_it_ends_and_says_how_to_script_it(inside, data, tmp_path):
    answer = inside("calibrate", "forearm", "--from", data, "--out", tmp_path / "forearm.yaml")
    assert answer.code == 130
    assert "Use --no-input" in answer.err
    assert files(tmp_path) == []


@pytest.mark.long
def test_from_the_first_question_to_the_stored_result_on_the_simulated_rig(program, tmp_path):
    (tmp_path / "settings.yaml").write_text(yaml.safe_dump(SETTINGS))
    words = ("--settings", "settings.yaml", "--touches", 3, "--out", "forearm.yaml", "--replace")
    terminal = program.terminal(tmp_path, "calibrate", "forearm", *words)
    terminal.until("Is its path clear", "y\n")
    terminal.until("1/15 FF presses table top")
    for number in range(1, 16):
        terminal.type("\n")
        terminal.until(f"{number}/15 ")
        terminal.until(": done")
    terminal.until("Store it as forearm.yaml?", "y\n")
    assert "PASS" in terminal.ended(0)
    assert read_record(tmp_path / "forearm.yaml").details["motion"]["touches"] == 15
    mount = load_forearm(tmp_path / "forearm.yaml").world_T_mount.pose()
    assert np.linalg.norm(mount.translation()) < 0.004


@pytest.mark.long
def test_a_session_on_an_expired_calibration_is_refused_or_says_that_it_was_allowed(inside, tmp_path):
    shutil.copytree(RIGS / "calibrations", tmp_path / "calibrations")
    rig = Path(shutil.copy(RIGS / "sim.yaml", tmp_path / "mine.yaml"))
    file = tmp_path / "calibrations" / "simulated-hand" / "forearm.yaml"
    write_record(file, read_record(file).model_copy(update={"valid_until_utc": "2020-01-01T00:00:00+00:00"}))
    words = ("run", "--rig", rig, "--grasps", 1, "--method", "odometry", "--out", tmp_path / "runs", "--json")
    refused = inside(*words)
    assert (refused.code, "is valid until 2020-01-01" in refused.err) == (2, True)
    assert not (tmp_path / "runs").exists()
    allowed = inside(*words, "--allow-uncalibrated")
    assert "is valid until 2020-01-01T00:00:00+00:00: allowed, and recorded" in allowed.err
    (session,) = (tmp_path / "runs").iterdir()
    (overlooked,) = load(session / "session.yaml")["settings"]["uncalibrated"]
    assert "forearm calibration" in overlooked


@pytest.mark.long
@pytest.mark.parametrize("rig", ["sim-left", "sim-lite"])
@pytest.mark.parametrize(
    "words",
    [("forearm", "--method", "touch"), ("forearm", "--method", "marker"), ("joints",), ("fingertip", "--finger", "FF")],
    ids=" ".join,
)
def test_calibrations_move_a_hand_of_any_form(inside, tmp_path, rig, words):
    answer = inside("calibrate", *words, "--rig", rig, "--out", tmp_path / "found.yaml", "--no-input", "--json")
    assert answer.code == 0, answer.err
    assert files(tmp_path) == ["found.yaml"]
    assert json.loads(answer.out)["passed"]


def test_poses_of_another_program_are_solved_for_a_hand_of_any_form(inside, tmp_path):
    streams = simulated_streams(7, 0.3, stamped=False)
    content = {
        name: {"rate_hz": rate, "poses": [pose.matrix().tolist() for pose in stream.poses]}
        for name, rate, stream in (
            ("mount_T_hand", HAND_Hz, streams.mount_T_hand),
            ("camera_T_target", TARGET_Hz, streams.camera_T_target),
        )
    }
    source = tmp_path / "streams.json"
    source.write_text(json.dumps({"format": "tactile-pose-streams/1", "most_poses": 20, **content}))
    answer = inside(
        "calibrate", "forearm", "--rig", "sim-lite", "--from", source, "--out", tmp_path / "found.yaml", "--no-input"
    )
    assert answer.code == 0, answer.err
    for told in (
        r"print +[-+]0\.\d\d \+- .* % larger than stated",
        r"delay +50\d\d\.",
        r"Shah +\d.* deg away",
        "Park and Martin ",
    ):
        assert re.search(told, answer.out), told
    details = read_record(tmp_path / "found.yaml").details
    assert details["delay_s"] == pytest.approx(5.0, abs=0.01)  # the hand's stream began 5 s sooner
