"""The command line on terminals of several widths, and shells that complete it: in processes of their own."""

from __future__ import annotations

import os
import re
import shutil
import sys
from pathlib import Path

import pexpect
import pytest

from tests.support.repository import REPOSITORY
from tests.support.warm_terminal import PATIENCE_s

RIGS = ("sim", "sim-biotac", "sim-wire", "sim-wire-biotac")
ESCAPE = re.compile(r"\x1b\[[0-9;?]*[a-zA-Z]")


def environment(**more: str) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES", "NO_COLOR")}
    return {**kept, "PYTHONPATH": str(REPOSITORY), "TERM": "xterm-256color", **more}


def on_terminal(width: int, *words: str, **more: str) -> tuple[int, str]:
    """Exit code, and everything shown on a terminal that is so wide."""
    command = ["-m", "tactile_lab", *words]
    child = pexpect.spawn(
        sys.executable,
        command,
        env=environment(**more),  # type: ignore[arg-type]
        dimensions=(40, width),
        encoding="utf-8",
        timeout=PATIENCE_s * 6,
    )
    child.expect(pexpect.EOF)
    child.close()
    return child.exitstatus, child.before


@pytest.mark.parametrize("width", [60, pytest.param(200, marks=pytest.mark.long)])
def test_a_table_fits_its_terminal_and_loses_nothing(width):
    code, shown = on_terminal(width, "rig", "list")
    lines = [ESCAPE.sub("", line).rstrip() for line in shown.splitlines()]
    assert code == 0
    assert max(map(len, lines)) <= width
    assert all(re.search(rf"(^|\s){re.escape(rig)}(\s|$)", "\n".join(lines)) for rig in RIGS)
    assert "Traceback" not in shown


def test_help_and_mistakes_fit_a_narrow_terminal():
    code, shown = on_terminal(60, "run", "--nope")
    assert code == 2
    plain = ESCAPE.sub("", shown)
    assert "--nope" in plain
    assert max(len(line.rstrip()) for line in plain.splitlines()) <= 60


def test_colours_are_for_terminals_and_can_be_refused(tactile_lab):
    assert "\x1b[" in on_terminal(80, "session", "show", "nowhere")[1]
    assert "\x1b[3" not in on_terminal(80, "session", "show", "nowhere", NO_COLOR="1")[1]
    answer = tactile_lab("session", "show", "nowhere")
    assert (answer.code, answer.out) == (2, "")
    assert "\x1b" not in answer.err


_SCRIPT, _ZSH = "_TACTILE_LAB_COMPLETE=source", "PS1='> '; autoload -Uz compinit; compinit -u -d $HOME/dump"


@pytest.fixture
def program(tmp_path: Path) -> Path:
    """A folder with the program under its name."""
    script = tmp_path / "bin" / "tactile-lab"
    script.parent.mkdir()
    script.write_text(f'#!/bin/sh\nexec {sys.executable} -m tactile_lab "$@"\n')
    script.chmod(0o755)
    return script.parent


@pytest.mark.parametrize(
    ("shell", "words", "setup"),
    [
        ("bash", ("--norc", "--noprofile", "-i"), f'eval "$({_SCRIPT}_bash tactile-lab)"'),
        ("zsh", ("-f", "-i"), f'{_ZSH}; eval "$({_SCRIPT}_zsh tactile-lab)"'),
        ("zsh", ("-f", "-i"), f"tactile-lab --show-completion > $HOME/_tactile-lab; fpath+=$HOME; {_ZSH}"),
    ],
)
def test_shells_complete_commands_rigs_and_sessions(program, tmp_path, shell, words, setup):
    if shutil.which(shell) is None:
        pytest.skip(f"no {shell} on this computer")
    (tmp_path / "runs" / "20261123-box").mkdir(parents=True)
    (tmp_path / "runs" / "20261123-box" / "session.yaml").touch()
    path = f"{program}{os.pathsep}{os.environ['PATH']}"
    child = pexpect.spawn(
        shell,
        list(words),
        env=environment(PATH=path, TERM="dumb", HOME=str(tmp_path), PS1="> "),  # type: ignore[arg-type]
        cwd=str(tmp_path),
        dimensions=(40, 120),
        encoding="utf-8",
        timeout=PATIENCE_s * 6,
    )
    child.sendline(f"{setup}; echo rea''dy")
    child.expect_exact("ready\r\n")
    for typed, rest in (
        ("tactile-lab rig check sim-b", "iotac"),
        ("tactile-lab recons", "truct"),
        ("tactile-lab session show 2026", "1123-box"),
    ):
        child.send(f"{typed}\t")
        child.expect_exact(rest)
        child.sendcontrol("u")  # after Ctrl+C zsh would drop what is typed next
    child.sendline("exit")
    child.expect(pexpect.EOF)
    child.close()
