"""Wizards driven by a person at a terminal: from start to stored result, and ended at every step."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import yaml

from calibration.fingertip.data import load_fingertip_data
from calibration.forearm.recordings import ForearmData, save_data
from calibration.forearm.touch_plan import plan_touches
from calibration.store.store import read_record
from drivers.camera.calibration import load_camera
from drivers.camera.rendering.board_camera import simulated_lens
from drivers.core.fingertip import load_fingertips
from drivers.shadow.model.joint_calibration import JointCalibration
from tactile_lab.experiments.data.calibration_data import TrueRig, touches_of
from tactile_lab.experiments.runs.calibration_runs import GEOMETRY
from tactile_lab.rigs.description import load_rig
from tests.support.warm_terminal import INTERRUPT, Terminal, WarmProgram

RIG = load_rig("sim")
FAST = {"travel_m_s": 0.5, "turn_rad_s": 2.4, "press_m_s": 0.04, "settle_s": 0.2, "fingers_rad_s": 2.0}
OLD = "an older result\n"
MEASURED_deg = {0: 1.1, 45: 46.0, 90: 91.2}

FOREARM = ("forearm", "--touches", 3, "--settings", "fast.yaml", "--record", "poses.json", "--out", "result.yaml")
TOUCHED = ("forearm", "--from", "touches.json", "--out", "result.yaml")
CAMERA = ("camera", "simulated:board", "--size", "640x480", "--out", "result.yaml")
FINGERTIP = ("fingertip", "--finger", "FF", "--presses", 8, "--settings", "fast.yaml", "--out", "result.yaml")
SOLVED = ("fingertip", "--from", "wrenches.yaml", "--out", "result.yaml")
JOINTS = ("joints", "--from", "poses.yaml", "--out", "result.yaml")

STORE, REPLACE = "Store it as result.yaml?", "result.yaml exists. Replace it?"


class At(NamedTuple):
    """A step of a wizard: its words, and what is answered to what until the step's own question is shown."""

    words: tuple[object, ...]
    answers: tuple[tuple[str, str], ...]
    question: str


BEGUN = ((REPLACE, "y\n"), ("Is its path clear?", "y\n"))

STEPS = {
    "forearm, replace": At(FOREARM, (), REPLACE),
    "forearm, begin": At(FOREARM, BEGUN[:1], "Is its path clear?"),
    "forearm, first touch": At(FOREARM, BEGUN, "1/15 FF presses"),
    "forearm, later touch": At(FOREARM, (*BEGUN, ("1/15 FF presses", "\n")), "2/15 MF presses"),
    "forearm, store": At(TOUCHED, BEGUN[:1], STORE),
    "camera, replace": At(CAMERA, (), REPLACE),
    "camera, begin": At(CAMERA, BEGUN[:1], "begin"),
    "camera, while pictures are taken": At(CAMERA, (*BEGUN[:1], ("begin", "\n")), "2 views"),
    "camera, store": At(CAMERA, (*BEGUN[:1], ("begin", "\n"), ("12 views", "d\n")), "Store it as result"),
    "fingertip, replace": At(FINGERTIP, (), REPLACE),
    "fingertip, begin": At(FINGERTIP, BEGUN[:1], "Is its path clear?"),
    "fingertip, free": At(FINGERTIP, BEGUN, "1/16 FF free"),
    "fingertip, pressed": At(
        FINGERTIP,
        (*BEGUN, *((f"{step}/16", "s\n") for step in range(1, 9))),
        "9/16 FF presses",
    ),
    "fingertip, store": At(SOLVED, BEGUN[:1], STORE),
    "joints, store": At(JOINTS, BEGUN[:1], STORE),
    "joints, replace": At(JOINTS, (), REPLACE),
}
LENGTHY = ("forearm, later touch", "camera, while pictures are taken", "camera, store", "fingertip, pressed")


@pytest.fixture(scope="module")
def measured(program: WarmProgram, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which a person measured a fingertip and stored the result; only to be read."""
    folder = prepared(tmp_path_factory.mktemp("measured"))
    terminal = program.terminal(folder, "calibrate", *FINGERTIP, "--record", "wrenches.yaml")
    terminal.until("Is its path clear?", "y\n")
    terminal.until("1/16 FF free", "\n")
    terminal.until("2/16 FF free", "u\n")  # take it back, and do it again
    terminal.until("1/16 FF free", "\n")
    for step in range(2, 17):
        terminal.until(f"{step}/16", "s\n" if step in (6, 7) else "\n")
    terminal.until("Store it as ", "y\n")
    (folder / "told.txt").write_text(terminal.ended(0))
    return folder


def prepared(folder: Path) -> Path:
    """Settings and recorded data beside which a wizard is called."""
    (folder / "fast.yaml").write_text(yaml.safe_dump({"measurer": FAST}))
    poses = [{"known_deg": {"FFJ3": a}, "measured_deg": {"FFJ3": b}} for a, b in MEASURED_deg.items()]
    table = {"format": "tactile-joint-poses/1", "rig": "simulated-hand", "poses": poses}
    (folder / "poses.yaml").write_text(yaml.safe_dump(table))
    rng = np.random.default_rng(3)
    touches = touches_of(plan_touches(GEOMETRY, per_patch=4), TrueRig.draw(rng), rng)
    save_data(folder / "touches.json", ForearmData(rig="simulated-hand", touches=tuple(touches)))
    return folder


def copied(measured: Path, folder: Path) -> dict[str, str]:
    """All of that beside an older result, before a wizard is called; gives the contents of all files."""
    for name in ("fast.yaml", "poses.yaml", "touches.json", "wrenches.yaml"):
        shutil.copy(measured / name, folder)
    (folder / "result.yaml").write_text(OLD)
    return contents(folder)


def contents(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir()}


def test_a_fingertip_is_measured_and_stored(measured: Path) -> None:
    assert "PASS" in (measured / "told.txt").read_text()
    data = load_fingertip_data(measured / "wrenches.yaml", RIG.installation)
    assert (len(data.free), len(data.presses)) == (6 + 8, 8)  # every press begins untouched
    true, found = load_fingertips(RIG.files["fingertips"])["FF"], load_fingertips(measured / "result.yaml")["FF"]
    assert found.mass_kg == pytest.approx(true.mass_kg, abs=1e-3)
    np.testing.assert_allclose(found.centre_distal_m, true.centre_distal_m, atol=2e-3)


def test_a_lens_is_shown_guided_and_stored(program: WarmProgram, tmp_path: Path) -> None:
    terminal = program.terminal(tmp_path, "calibrate", *CAMERA, "--notes", "by a test")
    terminal.until("begin", "\n")
    terminal.until("next: the board in the")
    terminal.until("coverage complete", "d\n")
    terminal.until(STORE, "y\n")
    told = terminal.ended(0)
    assert re.search(r"fx_px +7\d\d\.\d+ ", told)
    assert "To use it, name it in the rig file: calibration.camera: result.yaml" in told
    record, lens = read_record(tmp_path / "result.yaml"), load_camera(tmp_path / "result.yaml")
    assert (record.verdict, record.notes) == ("PASS", "by a test")
    assert len(record.residuals["per_view_px"]) < 40  # it ended when the person was done, not with the last picture
    np.testing.assert_allclose(lens.focal_px, simulated_lens((640, 480)).focal_px, rtol=0.01)


def test_joints_are_corrected_and_an_older_file_replaced(program: WarmProgram, measured: Path, tmp_path: Path) -> None:
    copied(measured, tmp_path)
    terminal = program.terminal(tmp_path, "calibrate", *JOINTS)
    terminal.until(REPLACE, "maybe\n")
    terminal.until("'maybe' is not one of the answers")
    terminal.until(REPLACE, "yes\n")
    terminal.until(STORE, "\n")
    assert "PASS" in terminal.ended(0)
    assert read_record(tmp_path / "result.yaml").details["FFJ3"]["poses"] == 3
    JointCalibration.load(tmp_path / "result.yaml")


@pytest.mark.parametrize(
    ("step", "way_out"),
    [
        pytest.param(
            step,
            "q\n" if step.endswith("begin") else INTERRUPT,
            marks=[pytest.mark.long] if step in LENGTHY else [],
        )
        for step in STEPS
    ],
    ids=lambda value: {INTERRUPT: "Ctrl+C", "q\n": "q"}.get(value, value),
)
def test_ended_at_any_step_nothing_is_stored(
    program: WarmProgram, measured: Path, tmp_path: Path, step: str, way_out: str
) -> None:
    at = STEPS[step]
    before = copied(measured, tmp_path)
    terminal = program.terminal(tmp_path, "calibrate", *at.words)
    leave(terminal, at, way_out)
    assert contents(tmp_path) == before


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda data: wrenches(data, -1.0), "opposite sign"),
        (lambda data: {**data, "presses": data["presses"][:2]}, "2 presses, but 6 are needed"),
        (lambda data: {**data, "rig": "another"}, "another"),
    ],
)
def test_wrenches_that_can_not_be_right_are_refused(
    inside: Any, measured: Path, tmp_path: Path, spoil: Any, words: str
) -> None:
    source = tmp_path / "spoilt.yaml"
    source.write_text(yaml.safe_dump(spoil(yaml.safe_load((measured / "wrenches.yaml").read_text()))))
    answer = inside("calibrate", "fingertip", "--from", source, "--out", tmp_path / "none.yaml", "--no-input")
    assert (answer.code, words in answer.err) == (2, True), answer.err
    assert contents(tmp_path).keys() == {"spoilt.yaml"}


def test_a_fingertip_outside_its_limits_replaces_nothing(inside: Any, measured: Path, tmp_path: Path) -> None:
    strict, out = tmp_path / "strict.yaml", tmp_path / "result.yaml"
    strict.write_text(yaml.safe_dump({"limits": {"force_mN": 0.001}}))
    words = ("--from", measured / "wrenches.yaml", "--settings", strict, "--out", out, "--no-input")
    answer = inside("calibrate", "fingertip", *words)
    assert (answer.code, "OUTSIDE" in answer.out) == (3, True), answer.err
    assert contents(tmp_path).keys() == {"strict.yaml", "result.failed.yaml"}


def wrenches(data: dict[str, Any], factor: float) -> dict[str, Any]:
    """The same data with all wrenches multiplied."""
    for entry in (*data["free"], *data["presses"]):
        entry["wrench"] = [factor * value for value in entry["wrench"]]
    return data


def test_ended_while_the_hand_moves_nothing_is_stored(program: WarmProgram, measured: Path, tmp_path: Path) -> None:
    before = copied(measured, tmp_path)
    terminal = program.terminal(tmp_path, "calibrate", *FINGERTIP, "--record", "wrenches.yaml")
    terminal.until(REPLACE, "y\n")
    terminal.until("Is its path clear?", "y\n")
    terminal.until("1/16", "\n")
    terminal.until("1/16 FF free, hand pitched 0 deg, rolled 0 deg: done")
    terminal.until("2/16", "\n")
    terminal.until("\n")  # the key is taken: the hand is on its way, which takes it longer than the key its own
    terminal.type(INTERRUPT)
    terminal.ended(130)
    assert contents(tmp_path) == before


def leave(terminal: Terminal, at: At, way_out: str) -> None:
    """Answer until the step's question, and end there."""
    for question, answer in at.answers:
        terminal.until(question, answer)
    terminal.until(at.question, way_out)
    told = terminal.ended(130)
    assert way_out == INTERRUPT or "Nothing was stored" in told, told
