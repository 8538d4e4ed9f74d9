"""A package outside this repository adds a plug-in of every kind: built, installed, listed, used and recorded."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner, Result

from drivers.core.installed.plugins import installed_plugins
from drivers.core.registry import Registry
from drivers.fingertips.kinds import WIRES
from sessions.recording.session import Session
from tactile_lab.cli.app import app
from tests.support.extending_page import rig_keys
from tests.support.low_rig import low_rig
from tests.support.plugin_package import install_package

KINDS = {
    ("policies", "quickest"), ("shape_models", "circle"), ("methods", "unturned"), ("figures", "heaviest_touch_n"),
    ("exporters", "npz"), ("fingertips", "six-floats"), ("simulated_fingertips", "six-floats"), ("wires", "text-udp"),
    ("positioners", "text"), ("simulated_positioners", "text"),
}  # fmt: skip


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return install_package(tmp_path_factory.mktemp("package"))


@pytest.fixture
def package(installed: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The package is installed in this process, until the test ends."""
    monkeypatch.syspath_prepend(str(installed))
    forget_plugins()
    yield installed
    monkeypatch.undo()
    forget_plugins()


def forget_plugins() -> None:
    installed_plugins.cache_clear()
    for registry in Registry._all:
        registry._loaded.clear()


def tactile_lab(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)


def test_plugins_are_listed_with_version_and_file(package: Path) -> None:
    answer = tactile_lab("plugins", "--json")
    assert answer.exit_code == 0, answer.output
    listed = [one for one in json.loads(answer.stdout) if one["package"] == "other-laboratory"]
    assert {(one["kind"], one["name"]) for one in listed} == KINDS
    assert {one["version"] for one in listed} == {"1.2.0"}
    assert all(one["file"].startswith(str(package)) for one in listed)
    assert not any(one["problem"] for one in listed)
    assert WIRES["text-udp"].settings.__name__ == "TextSettings"
    assert "other-laboratory 1.2.0" in " ".join(tactile_lab("plugins").output.split())


@pytest.mark.long  # quicker: plugins are listed
def test_a_session_uses_them_and_says_so_in_its_record(package: Path, tmp_path: Path) -> None:
    rig, runs = low_rig(tmp_path, rig_keys("six_floats.py"), rig_keys("text_positioner.py")), tmp_path / "runs"
    keys = yaml.safe_load(rig.read_text())
    del keys["extensions"]
    keys["conductor"]["fixed_grasps"] = 1
    rig.write_text(yaml.safe_dump(keys))
    words = ["run", "--rig", rig, "--grasps", 2, "--policy", "quickest", "--method", "unturned", "--out", runs]
    ran = tactile_lab(*words, "--no-input", "--json")
    assert ran.exit_code in (0, 3), ran.stderr
    assert json.loads(ran.stdout)["further"]["heaviest_touch_n"] > 0.05
    (folder,) = runs.iterdir()
    session = Session.open(folder)
    used = session.manifest.settings["plugins"]
    assert {(use["kind"], use["name"]) for use in used} == {
        ("fingertip kind", "six-floats"), ("simulated fingertip kind", "six-floats"), ("positioner", "text"),
        ("simulated positioner", "text"), ("policy", "quickest"), ("method", "unturned"),
    }  # fmt: skip
    assert {(use["package"], use["version"]) for use in used} == {("other-laboratory", "1.2.0")}

    place = tmp_path / "contacts.npz"
    exported = tactile_lab("session", "export", folder, "--as", f"npz={place}")
    assert exported.exit_code == 0, exported.output
    with np.load(place) as arrays:
        assert arrays["points_world_m"].shape[1] == 3

    made = tactile_lab("reconstruct", folder, "--shape", "circle", "--method", "odometry", "--out", tmp_path / "round")
    assert made.exit_code in (0, 3), made.output
    assert "circle" in (tmp_path / "round" / "slam.json").read_text()
