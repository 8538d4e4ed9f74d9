"""The wheel and the sdist: both are built, hold the same program, and it runs from where they were installed."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGES = ("tactile_lab", "drivers", "calibration", "sessions")
UV = str(Path(sys.executable).parent / "uv")
BUILD = "import sys; from setuptools import build_meta as b; print(getattr(b, sys.argv[1])(sys.argv[2]))"

pytestmark = pytest.mark.long


def build(source: Path, kind: str, out: Path) -> Path:
    """Build as pip would, with the setuptools that is here, so that no network is needed."""
    words = [sys.executable, "-W", "ignore", "-c", BUILD, kind, str(out)]
    done = subprocess.run(words, cwd=source, capture_output=True, text=True, check=True)
    return out / done.stdout.splitlines()[-1]


def program_files(wheel: Path) -> set[str]:
    return {name for name in zipfile.ZipFile(wheel).namelist() if name.split("/")[0] in PACKAGES}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The wheel, and a wheel made from the unpacked sdist."""
    folder = tmp_path_factory.mktemp("built")
    for package in PACKAGES:
        shutil.copytree(REPOSITORY / package, folder / "source" / package, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(REPOSITORY / name, folder / "source")
    with tarfile.open(build(folder / "source", "build_sdist", folder)) as archive:
        archive.extractall(folder / "unpacked", filter="data")
    (unpacked,) = (folder / "unpacked").iterdir()
    for name in ("first", "second"):
        (folder / name).mkdir()
    return build(folder / "source", "build_wheel", folder / "first"), build(unpacked, "build_wheel", folder / "second")


def test_wheel_and_sdist_hold_every_file_of_the_packages(built: tuple[Path, Path]) -> None:
    sources = {
        path.relative_to(REPOSITORY).as_posix()
        for package in PACKAGES
        for path in (REPOSITORY / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    for wheel in built:
        assert program_files(wheel) == sources


def test_the_program_runs_from_an_installed_wheel(built: tuple[Path, Path], tmp_path: Path) -> None:
    installed = tmp_path / "installed"
    with zipfile.ZipFile(built[1]) as wheel:
        wheel.extractall(installed)
    environment = os.environ | {"PYTHONPATH": str(installed)}
    words = [sys.executable, "-P", "-m", "tactile_lab", "run", "--rig", "sim", "--grasps", "2", "--no-input"]
    done = subprocess.run(
        [*words, "--out", str(tmp_path / "runs")],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    (session,) = (tmp_path / "runs").iterdir()
    assert (session / "results" / "report.html").is_file()
    where = "import tactile_lab, drivers; print(tactile_lab.__file__, drivers.__file__)"
    told = subprocess.run(
        [sys.executable, "-P", "-c", where], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    assert all(file.startswith(str(installed)) for file in told.stdout.split())


def interpreter(python: str) -> str:
    """Of this version: the running one, one that uv finds, or one of pyenv."""
    if python == f"{sys.version_info.major}.{sys.version_info.minor}":
        return sys.executable
    found = run(UV, "python", "find", "--offline", python)
    if found.returncode == 0:
        return found.stdout.strip()
    root = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    for program in sorted(root.glob(f"versions/{python}.*/bin/python")):
        return str(program)
    pytest.skip(f"there is no Python {python} here")


def install(wheel: Path, python: str, folder: Path) -> Path:
    """The base and nothing else in an environment of its own, from packages that are on this disk; its program."""
    made = run(UV, "venv", "--offline", "--python", interpreter(python), str(folder))
    assert made.returncode == 0, made.stderr
    locked = ("--offline", "--constraint", str(REPOSITORY / "requirements.lock"))
    done = run(UV, "pip", "install", *locked, "--python", str(folder / "bin" / "python"), str(wheel))
    if "network was disabled" in done.stderr:
        pytest.skip(f"not all packages of the base are on this disk for Python {python}")
    assert done.returncode == 0, done.stderr
    return folder / "bin" / "tactile-lab"


def run(*words: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    """A command that knows nothing of the running Python's packages."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(("python", "kind"), [("3.11", 1), ("3.12", 0), ("3.13", 1)])
def test_the_base_does_its_work_in_every_python(
    built: tuple[Path, Path], python: str, kind: int, session_copy: Path, tmp_path: Path
) -> None:
    """Installed from the wheel or by way of the sdist: the results are those of the session itself."""
    program = install(built[kind], python, tmp_path / "environment")
    (session_copy / "results" / "report.html").unlink()
    for words in ("reconstruct session --out again", "evaluate session --out figures", "report session"):
        done = run(str(program), *words.split(), folder=tmp_path)
        assert done.returncode in (0, 3), done.stderr
    for file in ("trajectory.csv", "contour.csv", "mesh.ply"):
        ours = session_copy / "results" / file
        assert not ours.is_file() or (tmp_path / "again" / file).read_bytes() == ours.read_bytes()
    assert (session_copy / "results" / "trajectory.csv").is_file()
    assert (session_copy / "results" / "report.html").is_file()
    assert (tmp_path / "figures" / "comparison.json").is_file()
