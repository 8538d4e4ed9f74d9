"""The base of an installation, without any package of an extra, does what it is for with a recorded session."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from drivers.core.installed.extras import EXTRAS

HIDDEN = """
import json
import sys

class Hidden:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name.partition(".")[0] in NAMES:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Hidden)
from tactile_lab.cli.main import main

codes = []
for words in json.loads(sys.argv[1]):
    try:
        main(words)
    except SystemExit as ended:
        codes.append(ended.code or 0)
print(json.dumps(codes))
"""


def base(*commands: Sequence[object], cwd: Path) -> tuple[list[int], str]:
    """Run ``tactile-lab`` where no package of an extra can be imported, command after command in one process.

    Returns:
        exit codes, and what was said on standard error.
    """
    words = json.dumps([list(map(str, each)) for each in commands])
    command = [sys.executable, "-c", HIDDEN.replace("NAMES", repr(set(EXTRAS))), words]
    environment = os.environ | {"COLUMNS": "200", "NO_COLOR": "1"}
    done = subprocess.run(command, capture_output=True, text=True, cwd=cwd, env=environment, timeout=300, check=False)
    assert "Traceback" not in done.stderr, done.stderr
    return json.loads(done.stdout.splitlines()[-1]), done.stderr


def test_a_session_is_evaluated_reported_and_exported(session_copy: Path) -> None:
    results = session_copy / "results"
    before = {name: (results / name).read_bytes() for name in ("evaluation.json", "report.html", "truth.csv")}
    report = results / "report.html"
    report.unlink()
    commands: list[tuple[object, ...]] = [
        ("evaluate", session_copy),
        ("report", session_copy),
        ("session", "list", "--root", "."),
        ("model", "export", session_copy, "--out", "model", "--format", "stl,urdf"),
    ]
    codes, said = base(*commands, cwd=session_copy.parent)
    assert codes == [0] * len(commands), said
    assert {name: (results / name).read_bytes() for name in before} == before


@pytest.mark.long
def test_bytes_and_contacts_are_estimated_again(session_copy: Path) -> None:
    commands: list[tuple[object, ...]] = [
        ("session", "replay", session_copy),
        ("session", "export", session_copy, "--contacts", "log.json"),
        ("reconstruct", "log.json", "--out", "again", "--json"),
    ]
    codes, said = base(*commands, cwd=session_copy.parent)
    assert codes == [0] * len(commands), said
    for name in ("trajectory.csv", "mesh.ply", "truth.csv"):
        assert (session_copy / "replay" / name).read_bytes() == (session_copy / "results" / name).read_bytes()


def test_what_looks_at_pictures_names_its_extra(recorded: Path, tmp_path: Path) -> None:
    codes, said = base(("evaluate", recorded, "--from", "pictures"), ("markers", "single"), cwd=tmp_path)
    assert codes == [2, 2]
    missing = "the package cv2 of the extra [camera] is not installed. Install it: python3 -m pip"
    assert said.count(missing) == 2
