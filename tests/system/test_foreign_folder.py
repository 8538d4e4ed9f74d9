"""The installed command in a folder full of Python files named like our packages and what they need."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from pkgutil import iter_modules

import pytest

from tactile_lab.rigs.description import shipped_rigs

NAMES = sorted(
    name
    for name in {"tests", *sys.stdlib_module_names, *(module.name for module in iter_modules())}
    if name.isidentifier() and not name.startswith("__")
)
"""Every module of the standard library, our packages, and all that is installed beside them."""


@pytest.fixture
def foreign_folder(tmp_path: Path) -> Path:
    folder = tmp_path / "work"
    folder.mkdir()
    assert {"drivers", "sessions", "numpy", "rtde_control", "json"} <= set(NAMES)
    for name in NAMES:
        (folder / f"{name}.py").write_text(f"open({str(tmp_path / 'executed')!r}, 'a').write(__name__)\n")
    return folder


def run_in(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [str(Path(sys.executable).with_name("tactile-lab")), *words]
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300, check=False
    )


def test_workers_of_an_experiment_execute_nothing_of_the_folder(foreign_folder: Path) -> None:
    done = run_in(
        foreign_folder,
        "experiment",
        "figure-2.5",
        "--seeds",
        "0",
        "--only",
        "contacts=10",
        "--jobs",
        "2",
        "--out",
        "..",
    )
    assert done.returncode == 0, done.stderr
    assert not (foreign_folder.parent / "executed").exists()


@pytest.mark.long
@pytest.mark.usefixtures("real_time_alone")
@pytest.mark.parametrize("rig", sorted(shipped_rigs()))
def test_every_rig_runs_and_nothing_of_the_folder_is_executed(foreign_folder: Path, rig: str) -> None:
    done = run_in(foreign_folder, "run", "--rig", rig, "--grasps", "1", "--seed", "1")
    assert done.returncode in (0, 3), done.stderr  # 3: on a busy machine messages come late
    assert "Traceback" not in done.stderr
    assert not (foreign_folder.parent / "executed").exists()
