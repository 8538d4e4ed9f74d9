"""What people who use shells do without thinking: ``-h``, ``| head``, ``--out=~/runs``, a variable that is not set."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from tactile_lab.cli.app import app
from tests.support.repository import REPOSITORY

WIDTHS = {"-h": 60, "--help": 200}
RED = "\x1b[31mred\a\u202e"


def run(*words: str, into: str = "/dev/null", **environment: str) -> subprocess.CompletedProcess[str]:
    """The program in a process of its own, its answer in a file."""
    with Path(into).open("w") as out:
        return subprocess.run(
            [sys.executable, "-m", "tactile_lab", *words],
            stdout=out,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": str(REPOSITORY), **environment},
            timeout=120,
            check=False,
        )


def every_command(command: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Its words, and those of all commands in it."""
    yield words
    if hasattr(command, "list_commands"):
        context = SimpleNamespace(params={})
        for name in command.list_commands(context):
            yield from every_command(command.get_command(context, name), (*words, name))


def test_every_command_explains_itself_within_the_terminal_by_either_word():
    commands = list(every_command(typer.main.get_command(app)))
    assert len(commands) > 35
    for words in commands:
        for word, width in WIDTHS.items():
            answer = CliRunner().invoke(app, [*words, word], env={"COLUMNS": str(width)})
            assert answer.exit_code == 0
            assert "Usage:" in answer.output
            assert max(map(len, answer.output.splitlines())) <= width


def test_help_and_version_have_other_names_too():
    assert CliRunner().invoke(app, ["help", "rig", "list"]).output == CliRunner().invoke(app, "rig list -h").output
    assert CliRunner().invoke(app, ["-V"]).output == CliRunner().invoke(app, ["--version"]).output


def test_a_mistyped_command_is_told_with_the_one_that_is_meant():
    assert "Did you mean 'session'?" in CliRunner().invoke(app, ["sesion", "list"]).output


@pytest.mark.parametrize(
    "words",
    [("session", "show", ""), ("run", "--out", ""), ("reconstruct", ""), ("rig", "show", ""), ("sweep", "--rig=")],
)
def test_a_variable_that_is_not_set_is_not_the_current_folder(inside, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    answer = inside(*words)
    assert answer.code == 2
    assert "must not be empty" in answer.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("session", "list", "--root=~/lab"), "no sessions in {home}/lab"),
        (("rig", "show", "~/lab.yaml"), "{home}/lab.yaml: file not found"),
        (("run", "--object", "mesh:~/cup.stl"), "{home}/cup.stl: file not found"),
    ],
)
def test_the_home_folder_is_meant_where_shells_do_not_put_it_in(inside, words, told, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    assert told.format(home=tmp_path) in inside(*words).err
    assert not list(tmp_path.iterdir())


def test_a_file_of_a_session_leads_to_the_session(inside, recorded):
    answer = inside("session", "show", recorded / "traffic.mcap")
    assert answer.code == 2
    assert f"is a file of a session. Name the folder: {recorded}" in answer.err


def test_names_with_blanks_and_other_alphabets_are_names(inside, recorded, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    log = tmp_path / "Mein Ordner ü" / "контакты 1.json"
    log.parent.mkdir()
    assert inside("session", "export", recorded, f"--contacts={log}").code == 0
    answer = inside("reconstruct", log, "--method", "odometry", "--out", log.parent / "ß out")
    assert answer.code in (0, 3)
    assert (log.parent / "ß out" / "contour.csv").is_file()
    assert str(log) in answer.out


def test_names_of_others_command_no_terminal(inside, tmp_path):
    rig = tmp_path / "rig.yaml"
    rig.write_text('"ke\\e]0;title\\ay": 1\n')
    for words in (
        ("session", "show", RED),
        ("rig", "show", RED),
        ("rig", "show", rig),
        ("session", "list", "--root", RED),
    ):
        answer = inside(*words)
        assert not set("\x1b\a\u202e") & set(answer.out + answer.err)
        assert "\\x1b" in answer.err


def test_a_table_in_a_pipe_has_one_line_a_row(inside):
    rows = [line for line in inside("rig", "list").out.splitlines() if line.startswith(" sim-wire")]
    assert [row.split()[0] for row in rows] == ["sim-wire", "sim-wire-biotac"]
    assert rows[1].rstrip().endswith("in real time")


def test_a_terminal_without_a_width_still_shows_everything(recorded, tmp_path):
    words = ("session", "list", "--root", str(recorded.parent))
    assert run(*words, into=str(tmp_path / "usual")).returncode == 0
    assert run(*words, into=str(tmp_path / "none"), COLUMNS="0").returncode == 0
    assert recorded.name in (tmp_path / "usual").read_text()
    assert (tmp_path / "none").read_text() == (tmp_path / "usual").read_text()


@pytest.mark.parametrize("words", [("--version",), ("session", "show", "-h"), ("--show-completion", "bash")])
def test_an_answer_that_cannot_be_written_is_told_whoever_writes_it(words):
    # from a shell that stays: completion is written for the shell among the program's parents
    program = [sys.executable, "-m", "tactile_lab", *words]
    typed = ["bash", "-c", '"$@" >/dev/full; exit $?', "bash", *program]
    ended = subprocess.run(typed, stderr=subprocess.PIPE, text=True, timeout=120, check=False, cwd=REPOSITORY)
    assert ended.returncode == 1
    assert ended.stderr == "error: standard output: the disk is full. Free some space, or send it elsewhere\n"


def test_help_may_be_read_in_part():
    words = f"set -o pipefail; {sys.executable} -m tactile_lab run -h | head -n 1"
    ended = subprocess.run(["bash", "-c", words], capture_output=True, timeout=120, check=False, cwd=REPOSITORY)
    assert (ended.returncode, ended.stderr) == (0, b"")


@pytest.mark.parametrize(
    "changed",
    [
        {"HOME": "/nonexistent", "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        pytest.param({"TMPDIR": "/nonexistent"}, marks=pytest.mark.long),
    ],
)
def test_a_bare_environment_changes_nothing(changed, recorded, tmp_path):
    for name, more in (("usual", {}), ("bare", changed)):
        ended = run("session", "show", str(recorded), into=str(tmp_path / name), **more)
        assert (ended.returncode, ended.stderr) == (0, "")
    assert (tmp_path / "bare").read_bytes() == (tmp_path / "usual").read_bytes()
