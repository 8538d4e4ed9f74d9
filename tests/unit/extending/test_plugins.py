"""Plug-ins that cannot be used: named with file and package, and nothing else is affected."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from gtsam import Pose3
from typer.testing import CliRunner

from drivers.core.contacts import Contact, Grasp
from drivers.core.errors import ConfigurationError, EstimationError, SessionError
from drivers.core.extensions import blamed
from drivers.core.installed.plugins import installed_plugins
from drivers.core.registry import Registry
from drivers.fingertips.kinds import FINGERTIPS
from sessions.recording.session import Session
from tactile_lab.cli.app import app
from tactile_lab.slam.exploration.policies import POLICIES, make_policy
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.workflow.exporters import EXPORTERS, export_as
from tactile_lab.workflow.plugging import changed_plugins, check_plugins, refused_plugins

Install = Callable[..., Path]
LOGS = Path(__file__).resolve().parents[2] / "logs"


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Installs a package of one module: its entry points, its text, what it requires."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def write(package: str, entries: str, text: str = "", requires: str = "tactile-lab", version: str = "2.0") -> Path:
        module, information = tmp_path / f"{package}.py", tmp_path / f"{package}-{version}.dist-info"
        module.write_text(text)
        sys.modules.pop(package, None)
        information.mkdir()
        head = f"Metadata-Version: 2.1\nName: {package}\nVersion: {version}\n"
        (information / "METADATA").write_text(f"{head}Requires-Dist: {requires}\n")
        (information / "entry_points.txt").write_text(entries)
        forget_plugins()
        return module

    yield write
    monkeypatch.undo()
    forget_plugins()


def forget_plugins() -> None:
    installed_plugins.cache_clear()
    for registry in Registry._all:
        registry._loaded.clear()


def entry(group: str, name: str, target: str) -> str:
    return f"[tactile_lab.{group}]\n{name} = {target}\n"


def test_one_that_raises_is_named_with_its_file_and_line_and_leaves_the_others(install: Install) -> None:
    file = install("broken_lab", entry("policies", "mine", "broken_lab:Mine"), "x = 1\ny = x / 0\n")
    assert "mine" in POLICIES
    with pytest.raises(
        ConfigurationError, match=rf"{file}: the plug-in 'mine' of broken_lab 2.0.*ZeroDivision.*line 2"
    ):
        make_policy("mine")
    assert make_policy("random").name == "random"
    ((plugin, problem),) = [one for one in check_plugins() if one[0].package == "broken_lab"]
    assert plugin.file == str(file)
    assert "could not be loaded" in problem


def test_one_that_ends_the_program_at_import_ends_nothing(install: Install) -> None:
    file = install("quitting_lab", entry("policies", "mine", "quitting_lab:Mine"), "import sys\nsys.exit(4)\n")
    answer = CliRunner().invoke(app, ["plugins", "--json"])
    assert answer.exit_code == 3
    (told,) = json.loads(answer.stdout)
    assert told["file"] == str(file)
    assert "'mine' of quitting_lab 2.0 could not be loaded: SystemExit: 4 (line 2)" in told["problem"]


def test_an_object_that_is_not_there(install: Install) -> None:
    install("empty_lab", entry("policies", "mine", "empty_lab:Mine"))
    with pytest.raises(ConfigurationError, match=r"AttributeError.*Mine"):
        make_policy("mine")


def test_one_made_for_another_version_names_both(install: Install) -> None:
    install("old_lab", entry("policies", "mine", "old_lab:Mine"), "Mine = object", "tactile-lab<0.1")
    with pytest.raises(
        ConfigurationError, match=r"old_lab 2.0 is made for tactile-lab <0.1, and this is \d.*: install"
    ):
        make_policy("mine")
    assert "mine" not in list(POLICIES)
    assert any("old_lab" in told for told in refused_plugins())


def test_a_name_that_is_taken_stays_with_whom_it_belongs_and_is_told(install: Install) -> None:
    install("greedy_lab", entry("policies", "random", "greedy_lab:Mine"), "Mine = object")
    assert type(make_policy("random")).__name__ == "RandomPolicy"
    (told,) = (sentence for sentence in refused_plugins() if "greedy_lab" in sentence)
    assert "'random' of greedy_lab 2.0 is not used" in told
    assert "policies.py" in told
    answer = CliRunner().invoke(app, ["plugins", "--json"])
    assert answer.exit_code == 3
    assert "already used by" in json.loads(answer.stdout)[0]["problem"]


def test_two_packages_with_one_name_are_both_named(install: Install) -> None:
    for package in ("first_lab", "second_lab"):
        install(package, entry("policies", "mine", f"{package}:Mine"), "Mine = object")
    with pytest.raises(
        ConfigurationError, match=r"first_lab 2\.0 has a name that second_lab 2\.0 uses too: uninstall one"
    ):
        make_policy("mine")


def test_an_object_of_another_kind(install: Install) -> None:
    install("vague_lab", entry("fingertips", "mine", "vague_lab:Mine"), "class Mine: pass")
    with pytest.raises(ConfigurationError, match="no fingertip kind, but type"):
        FINGERTIPS["mine"]
    with pytest.raises(ValueError, match="no fingertip kind, but type"):
        FINGERTIPS.known("mine")
    assert [name for name, _ in FINGERTIPS.items()] == ["nano17", "biotac"]


@pytest.mark.parametrize("name", ["Mine", "my mine", "../mine"])
def test_names_are_words(install: Install, name: str) -> None:
    install("loud_lab", entry("policies", name, "loud_lab:Mine"), "Mine = object")
    with pytest.raises(ConfigurationError, match="a name that is none"):
        make_policy(name)


def test_a_kind_that_there_is_not(install: Install) -> None:
    install("lost_lab", entry("polices", "mine", "lost_lab:Mine"))
    assert any("there is no kind 'polices'" in problem for _, problem in check_plugins())


def grasp(index: int) -> Grasp:
    turns = np.linspace(0.0, 2 * np.pi, 5, endpoint=False) + 0.3 * index
    normals = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(5)])
    fingers = ("FF", "MF", "RF", "LF", "TH")
    contacts = tuple(Contact(finger, 0.03 * normal, normal) for finger, normal in zip(fingers, normals, strict=True))
    return Grasp(index, index, contacts, hand_motion_world=Pose3())


METHOD = """
import numpy as np
from dataclasses import replace
from tactile_lab.slam.tracking.baselines.odometry_tracker import OdometryTracker
class Mine(OdometryTracker):
    def estimate(self):
        {answer}
def mine(settings, start):
    return Mine(start.map, settings.motion)
"""


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ("1 / 0", r"the method 'mine' raises ZeroDivisionError: division by zero \(line 7\)"),
        ("return replace(super().estimate(), pose=np.full(3, np.nan))", "gives a pose that is not finite"),
    ],
)
def test_a_method_that_fails_is_named_and_the_recording_is_said_to_be_kept(
    install: Install, answer: str, words: str
) -> None:
    file = install("method_lab", entry("methods", "mine", "method_lab:mine"), METHOD.format(answer=answer))
    slam = TactileSlam(SlamSettings(method="mine"), seed=1)
    slam.add_grasp(grasp(0))
    with pytest.raises(EstimationError, match=words) as caught:
        slam.add_grasp(grasp(1))
    assert str(file) in str(caught.value)
    assert "reconstruct it with another method" in str(caught.value)


def test_a_plugin_that_nobody_caught_is_blamed(install: Install) -> None:
    file = install("sudden_lab", entry("policies", "mine", "sudden_lab:mine"), "def mine():\n    raise OSError('no')\n")
    with pytest.raises(OSError, match="no") as caught:
        POLICIES["mine"]()
    assert blamed(caught.value) == f"{file}: this plug-in failed: OSError: no (line 2)"


class _Recorded:
    """As much of a session as an exporter here looks at."""


@pytest.mark.parametrize(
    ("text", "words"),
    [("place.write_text('half')\n    1 / 0", "raises ZeroDivisionError"), ("return 3", "wrote nothing")],
)
def test_an_exporter_that_fails_or_writes_nothing_leaves_nothing(
    install: Install, tmp_path: Path, text: str, words: str
) -> None:
    install("export_lab", entry("exporters", "mine", "export_lab:mine"), f"def mine(session, place):\n    {text}\n")
    place = tmp_path / "new" / "out.txt"
    with pytest.raises(SessionError, match=f"the exporter 'mine' {words}"):
        export_as("mine", _Recorded(), place)  # type: ignore[arg-type]
    assert not any(place.parent.iterdir()) if place.parent.exists() else True
    assert list(EXPORTERS)[-1] == "mine"


def test_a_record_tells_which_versions_have_changed(install: Install, monkeypatch: pytest.MonkeyPatch) -> None:
    install("here_lab", entry("policies", "mine", "here_lab:Mine"))

    used = [{"package": "here_lab", "version": "1.0"}, {"package": "gone_lab", "version": "3"}]
    session = Session.__new__(Session)
    monkeypatch.setattr(type(session), "manifest", SimpleNamespace(settings={"plugins": used}), raising=False)
    assert list(changed_plugins(session)) == ["here_lab 1.0 then, 2.0 now", "gone_lab 3 then, not installed now"]
