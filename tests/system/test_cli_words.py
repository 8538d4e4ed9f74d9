"""Help, usage errors and the separation of people's text from JSON, without recording anything."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest
from typer.testing import CliRunner

from drivers.core.errors import TactileLabError
from tactile_lab.cli.app import app
from tactile_lab.cli.options import OUR_METHODS
from tactile_lab.slam.shape.selection.models import SHAPE_MODELS
from tactile_lab.slam.tracking.trackers import METHODS
from tests.support.repository import REPOSITORY

COMMANDS = (
    "run",
    "reconstruct",
    "evaluate",
    "markers",
    "report",
    "sweep",
    "bench",
    "experiment",
    "calibrate",
    "calibrate show",
    "calibrate forearm",
    "calibrate joints",
    "calibrate fingertip",
    "calibrate camera",
    "calibrate biotac",
    "calibrate electrodes",
    "session",
    "session list",
    "session show",
    "session replay",
    "session recover",
    "session extract",
    "session export",
    "session import",
    "rig",
    "rig list",
    "rig show",
    "rig check",
    "rig emulate",
)


def invoke(words: str):
    return CliRunner().invoke(app, words.split())


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(command):
    answer = invoke(f"{command} --help")
    assert "Usage:" in answer.output
    assert answer.exit_code == 0


@pytest.mark.parametrize("command", [c for c in COMMANDS if c not in {"calibrate", "session", "rig"}])
def test_every_command_has_the_options_that_scripts_rely_on(command):
    text = invoke(f"{command} --help").output
    assert "--json" in text
    assert "--no-input" in text


def test_help_loads_nothing_heavy():
    code = (
        "import sys; from typer.testing import CliRunner; from tactile_lab.cli.app import app;"
        "assert CliRunner().invoke(app, ['run', '--help']).exit_code == 0;"
        "heavy = {'numpy', 'gtsam', 'mujoco', 'cv2', 'scipy', 'matplotlib', 'numba', 'yaml', 'viser',"
        " 'trimesh', 'h5py'} & set(sys.modules);"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_a_bad_log_is_told_before_the_estimation_is_loaded(tmp_path):
    log = tmp_path / "log.json"
    log.write_text("[" * 50_000)
    code = (
        "import sys; from tactile_lab.cli.main import main\n"
        "try: main(sys.argv[1:])\n"
        "finally: print([n for n in sys.modules if n.startswith(('tactile_lab.slam', 'tactile_lab.workflow'))])"
    )
    told = subprocess.run([sys.executable, "-c", code, "reconstruct", log], capture_output=True, text=True, timeout=60)
    assert told.returncode == 2
    assert "is not JSON (nested too deeply)" in told.stderr
    assert told.stdout == "[]\n"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("bogus", "No such command"),
        ("run --nope", "--nope"),
        ("run --method guess", "'joint', 'particle', 'thesis-pf'"),
        ("run --dimension 4", "--dimension"),
        ("run --seed -1", "--seed"),
        ("run --seed one", "--seed"),
        ("run --grasps 0", "--grasps"),
        ("run --led-by hand", "--led-by': needs --mode guided"),
        ("run --pace 0", "--pace': needs --mode guided"),
        ("session show", "Missing argument"),
        ("session replay last --seed -2", "--seed"),
        ("rig check", "Missing argument"),
        ("sweep --seeds 1,x", "--seeds"),
        ("sweep --seeds -1", "--seeds"),
        ("sweep --dimensions 2,5", "--dimensions"),
        ("sweep --jobs 0", "--jobs"),
        ("sweep --jobs 257", "must be less than or equal to 256"),
        ("run --seed 4294967296", "--seed"),
        ("run --grasps 1001", "--grasps"),
        ("run --seed one", "must be a valid integer"),
        ("run --mode guided --pace nan", "--pace"),
        ("calibrate forearm --method manual --rpy-deg 0 0 inf", "must be a finite number, not inf"),
        ("session replay last --speed nan", "--speed"),
        ("experiment ablation --seeds 0-99999999", "--seeds"),
        ("markers chessboard --square-mm 1e308", "--square-mm"),
        ("markers single --number -1", "--number"),
        ("sweep --scheduler nonsense", "'nonsense' is no address of a scheduler, such as tcp://host:8786"),
        ("experiment ablation --scheduler http://host:8786", "is no address of a scheduler"),
        ("sweep --scheduler tcp://host:99999", "is no address of a scheduler"),
        ("run --notes \udcff", "must be text in UTF-8"),
        ("session show \udcff", "must be text in UTF-8"),
    ],
)
def test_a_usage_error_names_the_option_and_exits_with_2(words, told, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    answer = invoke(words)
    assert answer.exit_code == 2
    words = " ".join(answer.stderr.replace("│", " ").split())
    assert told in words
    assert "Value error" not in words
    assert "Input should" not in words
    assert answer.stdout == ""
    assert not list(tmp_path.iterdir())


def test_the_methods_on_offer_are_those_of_the_estimation():
    assert METHODS.registered() == OUR_METHODS


def test_the_shape_models_on_offer_are_those_there_are():
    offered = " ".join(invoke("reconstruct --help").stdout.replace("│", " ").split())
    assert all(name in offered for name in SHAPE_MODELS)


def test_the_rigs_are_listed_for_people_and_for_programs(inside):
    spoken, document = inside("rig", "list"), inside("rig", "list", "--json")
    assert (spoken.code, spoken.err) == (0, "")
    assert "sim-biotac" in spoken.out
    assert {rig["name"] for rig in json.loads(document.out)} >= {"sim", "sim-biotac"}
    assert document.err == ""


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("run", "--object", "boxx"), "there is no object 'boxx'"),
        (("run", "--policy", "guess"), "there is no policy 'guess'"),
        (("run", "--rig", "nowhere"), "nowhere"),
        (("run", "--method", "known-pose"), "known-pose"),
        (("run", "--object", "mesh:none.ply"), "none.ply: file not found"),
    ],
)
def test_what_does_not_exist_is_told_before_anything_is_begun(inside, words, told, tmp_path, monkeypatch):
    def begun(*arguments, **named):
        raise AssertionError("begun")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tactile_lab.workflow.running.open_laboratory", begun)
    monkeypatch.setattr("tactile_lab.workflow.running.check_calibration", begun)
    answer = inside(*words)
    assert (answer.code, answer.out) == (2, "")
    assert told in answer.err
    assert "Value error" not in answer.err
    assert not list(tmp_path.iterdir())


def test_a_shape_that_does_not_exist_is_told_before_anything_is_estimated(inside, tmp_path):
    contact = {"finger": "FF", "point_world_m": [0.03, 0.0, 0.0], "normal_world": [1.0, 0.0, 0.0]}
    log = {"format": "tactile-contacts/1", "dimension": 2, "point_sigma_m": 0.001, "normal_sigma_rad": 0.1}
    path = tmp_path / "log.json"
    path.write_text(json.dumps({**log, "grasps": [{"contacts": [contact], "hand_motion_world": np.eye(4).tolist()}]}))
    answer = inside("reconstruct", path, "--shape", "guess", "--out", tmp_path / "out")
    assert (answer.code, answer.out) == (2, "")
    assert "there is no shape model 'guess'" in answer.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "words",
    [
        ("session", "show", 300 * "a"),
        ("session", "list", "--root", 300 * "a"),
        ("session", "export", "none", "--csv", "loop/csv"),
        ("reconstruct", 300 * "a"),
        ("run", "--object", f"mesh:{300 * 'a'}"),
        ("evaluate", "none", "--lens", "loop"),
        ("calibrate", "show", "loop/x.yaml"),
    ],
)
def test_a_path_that_the_system_refuses_is_told_in_words(inside, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "loop").symlink_to("loop")
    answer = inside(*words)
    assert (answer.code, answer.out) == (2, "")
    assert re.search(r"cannot be used \((File name too long|Too many levels of symbolic links)\)", answer.err)
    assert len(answer.err) < 400


def test_an_export_refuses_what_exists_before_it_reads_anything(inside, tmp_path):
    (tmp_path / "there.zip").touch()
    answer = inside("session", "export", "no-such-session", "--archive", tmp_path / "there.zip")
    assert (answer.code, "there.zip: exists already" in answer.err) == (2, True)


def test_the_program_is_a_module_too():
    words = [sys.executable, "-m", "tactile_lab", "--version"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.startswith("tactile-lab ")


def test_make_alone_lists_the_targets():
    outer = {"MAKEFLAGS", "MAKELEVEL", "MFLAGS"}  # of the make that runs the tests
    own = {name: value for name, value in os.environ.items() if name not in outer}
    done = subprocess.run(["make"], capture_output=True, text=True, timeout=60, check=True, env=own, cwd=REPOSITORY)
    targets = [line.split()[0] for line in done.stdout.splitlines()[1:]]
    assert targets[0] == "help"
    assert {"demo", "test", "check", "bench", "clean"} <= set(targets)


def test_a_rig_is_checked_device_by_device(inside):
    answer = inside("rig", "check", "sim", "--json")
    assert answer.code == 0
    document = json.loads(answer.out)
    assert document["ready"] is True
    assert {"hand", "base", "camera", "fingertip FF", "fingertip TH"} <= {d["device"] for d in document["devices"]}


def test_nothing_is_coloured_or_boxed_for_a_program_that_reads_along(tactile_lab, recorded):
    listed = tactile_lab("session", "list", "--root", recorded.parent).out
    assert recorded.name in listed
    assert "\x1b" not in listed


def test_a_folder_without_sessions_is_no_error(inside, tmp_path):
    answer = inside("session", "list", "--root", tmp_path / "none")
    assert answer.code == 0
    assert "tactile-lab run" in answer.err
    assert json.loads(inside("session", "list", "--root", tmp_path / "none", "--json").out) == []


@pytest.mark.parametrize("words", ["session show", "session replay", "evaluate", "report"])
def test_a_session_that_does_not_exist_is_named(words, tmp_path):
    for name in ("nowhere", "last"):
        answer = invoke(f"{words} {name} --root {tmp_path}")
        assert isinstance(answer.exception, TactileLabError)
        assert answer.exception.exit_code == 2
        assert "tactile-lab" in str(answer.exception)
