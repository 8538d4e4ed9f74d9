"""What a shell offers behind the words of a command line."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tactile_lab.cli.app import app

PROGRAM = "tactile-lab"


def offered(*words: str) -> set[str]:
    """What bash gets for the last of some words."""
    environment = {
        "_TACTILE_LAB_COMPLETE": "complete_bash",
        "COMP_WORDS": " ".join([PROGRAM, *words]),
        "COMP_CWORD": str(len(words)),
    }
    answer = CliRunner().invoke(app, [], prog_name=PROGRAM, env=environment)
    assert answer.stderr == ""
    return set(answer.stdout.split())


@pytest.mark.parametrize(
    ("words", "among"),
    [
        (["re"], {"reconstruct", "report"}),
        (["session", "re"], {"replay", "recover"}),
        (["run", "--se"], {"--seed"}),
        (["run", "--rig", "sim-w"], {"sim-wire", "sim-wire-biotac"}),
        (["rig", "check", "sim-b"], {"sim-biotac"}),
        (["run", "--object", "box-1"], {"box-10x6x4"}),
        (["run", "--policy", "info"], {"information"}),
        (["run", "--method", "known"], {"known-pose"}),
        (["reconstruct", "x", "--shape", "sup"], {"superquadric"}),
        (["experiment", "abl"], {"ablation"}),
    ],
)
def test_names_are_offered(words, among):
    found = offered(*words)
    assert found >= among
    assert all(name.startswith(words[-1]) for name in found)


def test_sessions_under_the_root_are_offered(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for root, name in (("runs", "first"), ("runs", "second"), ("other", "third")):
        folder = tmp_path / root / name
        folder.mkdir(parents=True)
        (folder / "session.yaml").touch()
    assert offered("session", "show", "f") == {"first"}
    assert offered("session", "show", "l") == {"last"}
    assert offered("session", "show", "--root", "other", "t") == {"third"}
    assert offered("session", "show", "--root", "nowhere", "t") == set()


def test_bash_takes_the_script_that_the_program_writes(tmp_path):
    """The script of --show-completion, in a real bash: it asks the program, here a file that answers for it."""
    environment = {"_TACTILE_LAB_COMPLETE": "source_bash"}
    script = CliRunner().invoke(app, [], prog_name=PROGRAM, env=environment).stdout
    fake = tmp_path / PROGRAM
    fake.write_text(f"#!{sys.executable}\nimport os\nprint(os.environ['COMP_WORDS'].split()[-1] + '-wire')\n")
    fake.chmod(0o755)
    asked = f"{script}\nCOMP_WORDS=({PROGRAM} run --rig sim); COMP_CWORD=3; _tactile_lab_completion tactile-lab; "
    path = f"{tmp_path}{os.pathsep}{os.environ['PATH']}"
    told = subprocess.run(
        ["bash", "--norc", "-c", asked + 'echo "${COMPREPLY[@]}"'],
        env={"PATH": path},
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    assert told.stdout.strip() == "sim-wire"
    assert Path(fake).is_file()


def test_zsh_has_a_script_too():
    environment = {"_TACTILE_LAB_COMPLETE": "source_zsh"}
    script = CliRunner().invoke(app, [], prog_name=PROGRAM, env=environment).stdout
    assert script.strip().startswith("#compdef tactile-lab")
