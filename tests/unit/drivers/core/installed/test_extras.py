"""A light installation: the base works without packages of extras, and what is missing is named with its command."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path
from typing import cast

import pytest

from drivers.core.errors import ConfigurationError
from drivers.core.installed import extras
from drivers.core.installed.extras import EXTRAS, LazyPackage, explain_missing, require_package
from sessions.conductor.progress import NullProgress
from sessions.recording.session import Session
from tactile_lab.workflow.exporting import EXPORTS
from tactile_lab.workflow.running import SessionRequest, run_session
from tactile_lab.workflow.sweeping import check_sweep

REPOSITORY = Path(__file__).resolve().parents[5]
COMMAND = r"is not installed\. Install it: python3 -m pip --python .* install 'tactile-lab\[absent\]'$"

BASE = """
import sys

class Hidden:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name.partition(".")[0] in HIDDEN:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Hidden)
import tactile_lab.workflow.reconstructing, tactile_lab.workflow.finishing, tactile_lab.workflow.exporting
import tactile_lab.report.page, tactile_lab.evaluation.evaluation
import tactile_lab.workflow.running, tactile_lab.models.model_files
from tactile_lab.cli.main import main
main(sys.argv[1:])
"""


@pytest.fixture
def absent(monkeypatch: pytest.MonkeyPatch) -> str:
    """A package that nobody has, of an extra of its own."""
    monkeypatch.setitem(extras.EXTRAS, "surely_absent", "absent")
    return "surely_absent"


def test_every_extra_that_is_named_can_be_installed() -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    assert set(EXTRAS.values()) <= set(project["optional-dependencies"])


def test_what_is_missing_is_named_with_the_command_that_installs_it(absent: str) -> None:
    with pytest.raises(ConfigurationError, match=COMMAND):
        require_package(absent)
    lazy = LazyPackage(absent)
    with pytest.raises(ConfigurationError, match=COMMAND):
        lazy.File("x")


def test_only_modules_of_extras_are_explained() -> None:
    assert explain_missing(ModuleNotFoundError(name="a_users_own")) is None
    told = explain_missing(ModuleNotFoundError(name="viser.infra"))
    assert told is not None
    assert "'tactile-lab[view]'" in str(told)


def test_a_lazy_package_is_the_package_once_something_of_it_is_used() -> None:
    lazy = LazyPackage("json")
    assert lazy.loads("[1]") == [1]
    with pytest.raises(AttributeError):
        _ = lazy.nothing_of_this_name


def test_the_base_needs_no_package_of_an_extra_and_the_simulated_rig_names_its_own(tmp_path: Path) -> None:
    code = BASE.replace("HIDDEN", repr(set(EXTRAS)))
    words = ["run", "--rig", "sim", "--out", str(tmp_path / "runs"), "--no-input"]
    done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stderr
    assert "the package mujoco of the extra [sim] is not installed" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "runs").exists()


def test_a_sweep_and_exports_name_what_they_need_before_they_begin(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    with pytest.raises(ConfigurationError, match=r"mujoco of the extra \[sim\]"):
        check_sweep("sim", ("cube-6",), tmp_path / "sweep", "joint")
    assert not (tmp_path / "sweep").exists()
    unread = cast(Session, None)
    for name, package in {"hdf5": "h5py", "rosbag": "rosbags", "parquet": "pyarrow", "lerobot": "pyarrow"}.items():
        with pytest.raises(ConfigurationError, match=f"the package {package} of the extra"):
            EXPORTS[name](unread, tmp_path / name)


@pytest.mark.parametrize(("package", "extra"), [("numba", "explore"), ("cv2", "camera")])
def test_a_session_names_the_extra_that_its_policy_or_camera_needs(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, package: str, extra: str
) -> None:
    find = extras.find_spec
    monkeypatch.setattr(extras, "find_spec", lambda name: None if name == package else find(name))
    with pytest.raises(ConfigurationError, match=rf"{package} of the extra \[{extra}\]"):
        run_session(SessionRequest("sim", "box-10x6x4", tmp_path / "runs", policy="information"), NullProgress())
    assert not (tmp_path / "runs").exists()
