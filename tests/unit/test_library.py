"""The science as a library: contacts in, a contour with its uncertainty out, and no device is loaded for it."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import tactile_lab
from tests.support import public_api
from tests.support.repository import REPOSITORY

SESSION = """
import numpy as np
from gtsam import Pose3
from tactile_lab import Contact, Grasp, SlamSettings, TactileSlam

rng, slam = np.random.default_rng(0), TactileSlam(SlamSettings(dimension=2), seed=0)
for index in range(4):
    contacts = []
    for finger, turn in zip(("FF", "MF", "RF", "LF", "TH"), rng.uniform(0.0, 2.0 * np.pi, 5)):
        normal = np.array([np.cos(turn), np.sin(turn), 0.0])
        contacts.append(Contact(finger, 0.03 * normal + rng.normal(0.0, 0.0003, 3), normal))
    slam.add_grasp(Grasp(index, index, tuple(contacts), hand_motion_world=Pose3()))
outline = slam.finish().contour
radii_m = np.linalg.norm(outline.points_m - outline.points_m.mean(0), axis=1)
print(round(float(radii_m.mean()), 4), outline.sigma_m.max() > 0)
"""


def test_contacts_become_a_contour_with_sigma_in_fifteen_lines_without_any_driver() -> None:
    loaded = "\nimport sys\nprint(*sorted({name for name in sys.modules if name.startswith(('drivers', 'sessions'))}))"
    done = subprocess.run([sys.executable, "-c", SESSION + loaded], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    figures, names = done.stdout.splitlines()
    radius_m, has_sigma = figures.split()
    assert abs(float(radius_m) - 0.03) < 0.002
    assert has_sigma == "True"
    assert all(name == "drivers" or name.startswith("drivers.core") for name in names.split()), names
    assert len([line for line in SESSION.splitlines() if line]) <= 15


def test_everything_that_is_public_can_be_had_and_stands_in_the_reference_as_it_is() -> None:
    assert set(tactile_lab.__all__) == {*tactile_lab._PLACES, "__version__"}
    assert set(tactile_lab.__all__) <= set(dir(tactile_lab))
    assert public_api.PAGE.read_text() == public_api.page(), "run: python -m tests.support.public_api"


def test_the_version_is_that_of_the_project() -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    assert tactile_lab.__version__ == project["version"]
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = tactile_lab.nothing


def test_every_package_says_that_it_is_typed() -> None:
    packages = ("tactile_lab", "drivers", "calibration", "sessions")
    assert all((REPOSITORY / package / "py.typed").is_file() for package in packages)


@pytest.mark.parametrize("hiding", ["calibration.py", "sessions/__init__.py", "drivers/__init__.py"])
def test_a_users_own_file_with_a_name_of_ours_is_named_in_one_sentence(tmp_path: Path, hiding: str) -> None:
    file = tmp_path / hiding
    file.parent.mkdir(exist_ok=True)
    file.write_text("x = 1\n")
    code = "import tactile_lab"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    package = hiding.partition("/")[0].removesuffix(".py")
    wanted = f"ImportError: {file} hides the package '{package}' of tactile-lab: rename it, or start Python in another"
    assert done.stderr.splitlines()[-1] == f"{wanted} folder"
    words = [sys.executable, "-m", "tactile_lab", "--version"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, f"{wanted.replace('ImportError', 'error')} folder\n")


def test_a_users_own_folder_of_recordings_does_no_harm(tmp_path: Path) -> None:
    (tmp_path / "sessions" / "2026-01-01").mkdir(parents=True)
    code = "import tactile_lab; print(tactile_lab.Session.__module__)"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "sessions.recording.session", done.stderr
