"""Bad input, typed as a person would: one clear line, the right exit code, nothing recorded."""

from __future__ import annotations

import re
import shutil
from importlib import resources
from pathlib import Path

import pytest
import trimesh
import yaml

from drivers.core.calibration_file import is_stored
from drivers.core.configuration import load

RIGS = Path(str(resources.files("tactile_lab.rigs")))
CALIBRATION = "calibrations/simulated-hand"


@pytest.fixture
def rig_file(tmp_path: Path) -> Path:
    """A rig file of one's own, with calibration beside it, in plain form: one may write such files by hand."""
    shutil.copytree(RIGS / "calibrations", tmp_path / "calibrations")
    for file in (tmp_path / CALIBRATION).iterdir():
        if is_stored(content := load(file)):
            file.write_text(yaml.safe_dump(content["parameters"], sort_keys=False, default_flow_style=None))
    return Path(shutil.copy(RIGS / "sim.yaml", tmp_path / "mine.yaml"))


def one_line(answer, code: int, *words: str) -> None:
    """The command refused with one line that holds the words, and printed nothing for programs."""
    assert (answer.code, answer.out) == (code, "")
    errors = [line for line in answer.err.splitlines() if line.startswith("error: ")]
    assert len(errors) == 1, answer.err
    assert answer.err.splitlines()[-1] == errors[0]
    for word in words:
        assert word in errors[0]


@pytest.mark.parametrize(
    ("pattern", "replacement", "words"),
    [
        (r"\Z", "colour: red\n", ("colour: unknown key",)),
        (r"^cycle_s", "cycle_z", ("cycle_z: unknown key (did you mean cycle_s?)", "cycle_s: is missing")),
        (r"cycle_s: .*", "cycle_s: .nan", ("cycle_s: must be a finite number, not nan",)),
        (r"cycle_s: .*", "cycle_s: .inf", ("cycle_s: must be a finite number",)),
        (r"cycle_s: .*", "cycle_s: fast", ("cycle_s: must be a valid number, not 'fast'",)),
        (r"cycle_s: .*", "cycle_s: 5.0", ("cycle_s: must be less than or equal to 0.02, not 5.0",)),
        (r"^kind: .*", "kind: real", ("kind: must be 'simulated' or 'wired', not 'real'",)),
        (r"\Z", "cycle_s: 0.01\n", ("line ", "key 'cycle_s' appears twice")),
        (r"\Z", "hand: [1, 2\n", ("is not valid YAML", "line")),
        (
            r"\Z",
            "conductor: {grasps: 0, cycle: {grip: 1}}\n",
            ("conductor.grasps", "conductor.cycle.grip"),
        ),
        (r"joints: .*", "joints: nowhere.yaml", ("missing joints calibration", "calibration.joints")),
        (r"(?s)\A.*\Z", "", ("the document: must be keys with values",)),
    ],
)
def test_a_rig_file_that_does_not_fit(inside, rig_file, pattern, replacement, words):
    rig_file.write_text(re.sub(pattern, replacement, rig_file.read_text(), count=1, flags=re.M))
    one_line(inside("rig", "check", rig_file), 2, "mine.yaml", *words)


def test_a_rig_that_does_not_exist(inside, tmp_path):
    one_line(inside("rig", "check", "simm"), 2, "simm: no such rig", "sim-biotac")
    one_line(inside("rig", "check", tmp_path / "none.yaml"), 2, "none.yaml: file not found")
    one_line(inside("run", "--rig", "simm", "--out", tmp_path / "runs"), 2, "simm: no such rig")
    assert not (tmp_path / "runs").exists()


def test_a_rig_file_that_is_no_text(inside, tmp_path):
    (tmp_path / "photo.yaml").write_bytes(b"\xff\xd8\xff\xe0")
    one_line(inside("rig", "check", tmp_path / "photo.yaml"), 2, "photo.yaml: is not a text file")
    (tmp_path / "folder.yaml").mkdir()
    one_line(inside("rig", "check", tmp_path / "folder.yaml"), 2, "folder.yaml: cannot be read")


@pytest.mark.parametrize(
    ("file", "pattern", "replacement", "words"),
    [
        ("joints.yaml", r"\[2673, 22.5\]", "[3673, 22.5]", ("FFJ1", "not monotonic")),
        ("joints.yaml", "FFJ1", "FFJ9", ("misses FFJ1", "unknown FFJ9")),
        ("fingertips.yaml", "MF:", "XX:", ("unknown finger XX",)),
        ("fingertips.yaml", "mass_kg: .*", "mass_kg: .nan", ("fingertips.FF.mass_kg: must be a finite number",)),
        ("motors.yaml", "FFJ3: 1$", "FFJ3: 55", ("motor numbers",)),
        ("camera.yaml", "size_px: .*", "size_px: [640]", ("size_px",)),
        ("markers.yaml", "world_side_m: .*", "world_side_m: wide", ("world_side_m", "not 'wide'")),
        ("forearm.yaml", "translation_sigma_m: .*", "translation_sigma_m: -1.0", ("translation_sigma_m",)),
    ],
)
def test_a_broken_calibration_is_found_before_anything_is_recorded(inside, rig_file, file, pattern, replacement, words):
    calibration = rig_file.parent / CALIBRATION / file
    calibration.write_text(re.sub(pattern, replacement, calibration.read_text(), count=1, flags=re.M))
    one_line(inside("rig", "check", rig_file), 2, file, *words)
    one_line(inside("run", "--rig", rig_file, "--out", rig_file.parent / "runs"), 2, file, *words)
    assert not (rig_file.parent / "runs").exists()


def test_a_session_refuses_a_calibration_without_a_record_unless_allowed(inside, rig_file):
    words = ("forearm calibration", "is not a stored calibration", "--allow-uncalibrated")
    one_line(inside("run", "--rig", rig_file, "--out", rig_file.parent / "runs"), 2, "rig simulated-hand", *words)
    assert not (rig_file.parent / "runs").exists()


def test_a_session_refuses_a_calibration_changed_by_hand(inside, rig_file):
    stored = (RIGS / CALIBRATION / "forearm.yaml").read_text()
    changed = stored.replace("translation_m: [0.0, 0.0, 0.0]", "translation_m: [0.0, 0.0, 0.01]")
    (rig_file.parent / CALIBRATION / "forearm.yaml").write_text(changed)
    one_line(inside("run", "--rig", rig_file, "--out", rig_file.parent / "runs"), 2, "forearm.yaml", "changed by hand")


def test_a_finger_without_a_calibrated_tip_is_told(inside, rig_file):
    fingertips = rig_file.parent / CALIBRATION / "fingertips.yaml"
    content = load(fingertips)
    del content["fingertips"]["MF"]
    fingertips.write_text(yaml.safe_dump(content))
    answer = inside("rig", "check", rig_file)
    assert answer.code == 4  # plain figures do not say where they come from
    assert re.search(r"fingertip MF +ok +none", answer.out)


@pytest.fixture
def mesh_folder(tmp_path: Path) -> Path:
    block = trimesh.creation.box((0.06, 0.06, 0.06))
    block.copy().apply_scale(1000.0).export(tmp_path / "millimetres.stl")
    block.copy().apply_scale(0.01).export(tmp_path / "tiny.stl")
    block.update_faces([index > 5 for index in range(len(block.faces))])
    block.export(tmp_path / "open.stl")
    (tmp_path / "noise.stl").write_bytes(b"no mesh at all" * 20)
    (tmp_path / "empty.ply").write_bytes(b"")
    return tmp_path


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("missing.stl", ("file not found",)),
        ("noise.stl", ("noise.stl",)),
        ("empty.ply", ("damaged", "PLY")),
        ("open.stl", ("closed surface",)),
        ("millimetres.stl", ("millimetres?",)),
        ("tiny.stl", ("twice?",)),
    ],
)
def test_a_mesh_that_can_not_be_used(inside, mesh_folder, file, words):
    out = mesh_folder / "runs"
    one_line(inside("run", "--object", f"mesh:{mesh_folder / file}", "--out", out), 2, file, *words)
    assert not out.exists()


def test_an_object_that_is_not_in_the_catalogue(inside, tmp_path):
    one_line(inside("run", "--object", "boxx", "--out", tmp_path / "runs"), 2, "'boxx'", "box-10x6x4", "mesh:")
    one_line(inside("sweep", "--objects", "boxx", "--out", tmp_path / "sweep"), 2, "'boxx'", "box-10x6x4")
    assert not list(tmp_path.iterdir())


def test_a_folder_for_sessions_that_is_a_file(inside, tmp_path):
    (tmp_path / "file").write_text("")
    for command in ("run", "sweep"):
        one_line(inside(command, "--out", tmp_path / "file"), 2, str(tmp_path / "file"), "Choose another folder")


def test_a_list_of_sessions_in_a_file(inside, tmp_path):
    (tmp_path / "file").write_text("")
    one_line(inside("session", "list", "--root", tmp_path / "file"), 2, "cannot be read")


def test_a_current_folder_that_was_removed_is_named(inside, tmp_path, monkeypatch):
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    one_line(inside("run", "--grasps", 1), 2, "the current folder is not there any more. Change to another one")
