"""The base of an installation, without any package of an extra, does what it is for with a recorded session."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from drivers.core.installed.extras import EXTRAS

HIDDEN = """
import sys

class Hidden:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name.partition(".")[0] in NAMES:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Hidden)
from tactile_lab.cli.main import main
main(sys.argv[1:])
"""


def base(*words: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run ``tactile-lab`` where no package of an extra can be imported."""
    code = HIDDEN.replace("NAMES", repr(set(EXTRAS)))
    command = [sys.executable, "-c", code, *map(str, words)]
    environment = os.environ | {"COLUMNS": "200", "NO_COLOR": "1"}
    done = subprocess.run(command, capture_output=True, text=True, cwd=cwd, env=environment, timeout=300, check=False)
    assert "Traceback" not in done.stderr, done.stderr
    return done


def test_a_session_is_evaluated_reported_and_exported(session_copy: Path) -> None:
    results = session_copy / "results"
    before = {name: (results / name).read_bytes() for name in ("evaluation.json", "report.html", "truth.csv")}
    report = results / "report.html"
    report.unlink()
    for words in (("evaluate", session_copy), ("report", session_copy), ("session", "list", "--root", ".")):
        done = base(*words, cwd=session_copy.parent)
        assert done.returncode == 0, done.stderr
    assert {name: (results / name).read_bytes() for name in before} == before
    done = base("model", "export", session_copy, "--out", "model", "--format", "stl,urdf", cwd=session_copy.parent)
    assert done.returncode == 0, done.stderr


@pytest.mark.long
def test_bytes_and_contacts_are_estimated_again(session_copy: Path) -> None:
    folder = session_copy.parent
    done = base("session", "replay", session_copy, cwd=folder)
    assert done.returncode == 0, done.stderr
    for name in ("trajectory.csv", "mesh.ply", "truth.csv"):
        assert (session_copy / "replay" / name).read_bytes() == (session_copy / "results" / name).read_bytes()
    for words in (
        ("session", "export", session_copy, "--contacts", "log.json"),
        ("reconstruct", "log.json", "--out", "again", "--json"),
    ):
        done = base(*words, cwd=folder)
        assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("words", [("evaluate", "{session}", "--from", "pictures"), ("markers", "single")])
def test_what_looks_at_pictures_names_its_extra(recorded: Path, tmp_path: Path, words: tuple[str, ...]) -> None:
    done = base(*(word.format(session=recorded) for word in words), cwd=tmp_path)
    assert done.returncode == 2
    assert "the package cv2 of the extra [camera] is not installed. Install it: python3 -m pip" in done.stderr
