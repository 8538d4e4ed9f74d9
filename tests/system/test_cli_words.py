"""Help, usage errors and the separation of people's text from JSON, without recording anything."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from drivers.core.errors import TactileLabError
from tactile_lab.cli.app import app
from tactile_lab.cli.options import Method
from tactile_lab.slam.shape.selection.models import SHAPE_MODELS
from tactile_lab.slam.tactile_slam import SlamSettings

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
        "heavy = {'numpy', 'gtsam', 'mujoco', 'cv2', 'scipy', 'matplotlib', 'numba'} & set(sys.modules);"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


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
    ],
)
def test_a_usage_error_names_the_option_and_exits_with_2(words, told, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    answer = invoke(words)
    assert answer.exit_code == 2
    assert told in " ".join(answer.stderr.replace("│", " ").split())
    assert answer.stdout == ""
    assert not list(tmp_path.iterdir())


def test_the_methods_on_offer_are_those_of_the_estimation():
    schema = SlamSettings.model_json_schema()["properties"]["method"]
    assert {method.value for method in Method} == set(schema["enum"])


def test_the_shape_models_on_offer_are_those_there_are():
    offered = " ".join(invoke("reconstruct --help").stdout.replace("│", " ").split())
    assert all(name in offered for name in SHAPE_MODELS)


def test_the_rigs_are_listed_for_people_and_for_programs(inside):
    spoken, document = inside("rig", "list"), inside("rig", "list", "--json")
    assert (spoken.code, spoken.out) == (0, "")
    assert "sim-biotac" in spoken.err
    assert {rig["name"] for rig in json.loads(document.out)} >= {"sim", "sim-biotac"}
    assert document.err == ""


def test_a_rig_is_checked_device_by_device(inside):
    answer = inside("rig", "check", "sim", "--json")
    assert answer.code == 0
    document = json.loads(answer.out)
    assert document["ready"] is True
    assert {"hand", "base", "camera", "fingertip FF", "fingertip TH"} <= {d["device"] for d in document["devices"]}


def test_nothing_is_coloured_or_boxed_for_a_program_that_reads_along(tactile_lab):
    assert "\x1b" not in tactile_lab("rig", "list").err


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
        assert answer.exception.exit_code == 1
        assert "tactile-lab" in str(answer.exception)
