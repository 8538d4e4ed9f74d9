"""Registries and the files that add to them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from drivers.biotac.settings import BioTacSettings
from drivers.core.errors import ConfigurationError
from drivers.core.extensions import VARIABLE, load_extension, load_named_extensions, unload_extension
from drivers.core.registry import Registry
from drivers.fingertips.kinds import FINGERTIPS
from tactile_lab.rigs.description import describe, load_rig
from tactile_lab.slam.exploration.policies import POLICIES, make_policy
from tests.support.extending_page import Written
from tests.support.low_rig import low_rig

REGISTER = "from tactile_lab.slam.exploration.policies import POLICIES\nPOLICIES.register({name!r}, {item})\n"


@pytest.fixture
def colours() -> Iterator[Registry[int]]:
    made: Registry[int] = Registry("colour", form=int)
    made.register("red", 1)
    made.register("green", 2)
    yield made
    Registry._all.remove(made)


def test_entries_are_found_by_name_in_their_order(colours: Registry[int]) -> None:
    assert (list(colours), len(colours), colours["green"], "blue" in colours) == (["red", "green"], 2, 2, False)
    assert colours.file("red") == __file__
    assert (colours.file("blue"), [] in colours) == ("", False)


def test_an_unknown_name_is_told_with_those_there_are(colours: Registry[int]) -> None:
    with pytest.raises(ConfigurationError, match=r"there is no colour 'blue'. Colours are red, green.*--extension"):
        colours["blue"]
    with pytest.raises(ValueError, match=r"there is no colour 'blue'. Colours are red, green$"):
        colours.known("blue")
    assert colours.known("red") == "red"


@pytest.mark.parametrize("name", ["", "Red", "-red", "light red", "röt", "../red"])
def test_names_are_words_for_a_command_line_and_file_names(colours: Registry[int], name: str) -> None:
    with pytest.raises(ConfigurationError, match="registers a colour as"):
        colours.register(name, 3)


def test_a_taken_name_is_refused_and_both_files_are_named(written: Written) -> None:
    path = written("mine.py", REGISTER.format(name="random", item="object"))
    with pytest.raises(ConfigurationError, match=r"mine\.py: registers the policy 'random'.*used by .*policies\.py"):
        load_extension(path)
    assert POLICIES.file("random").endswith("exploration/policies.py")
    assert type(make_policy("random")).__name__ == "RandomPolicy"


def test_two_extensions_cannot_share_a_name_but_one_may_be_loaded_twice(written: Written) -> None:
    first, second = (written(name, REGISTER.format(name="mine", item="object")) for name in ("one.py", "two.py"))
    load_extension(first)
    load_extension(first)
    with pytest.raises(ConfigurationError, match=r"two\.py: registers the policy 'mine'.*already used by .*one\.py"):
        load_extension(second)
    assert POLICIES.file("mine") == str(first)
    unload_extension(first)
    load_extension(second)
    assert POLICIES.file("mine") == str(second)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("def broken(:\n", r"SyntaxError"),
        ("import no_such_library\n", r"ModuleNotFoundError: No module named 'no_such_library' \(line 3\)"),
        ("1 / 0\n", r"ZeroDivisionError: division by zero \(line 3\)"),
        ("raise SystemExit(4)\n", r"SystemExit: 4 \(line 3\)"),
    ],
)
def test_an_extension_that_cannot_be_loaded_is_named_and_leaves_nothing(
    written: Written, text: str, words: str
) -> None:
    path = written("broken.py", REGISTER.format(name="half", item="object") + text)
    with pytest.raises(ConfigurationError, match=rf"broken\.py: this extension could not be loaded: .*{words}"):
        load_extension(path)
    assert "half" not in POLICIES
    assert str(path) not in os.environ.get(VARIABLE, "")


@pytest.mark.parametrize(
    ("registry", "item", "words"),
    [
        ("drivers.fingertips.kinds.FINGERTIPS", "type('Kind', (), {})", "the fingertip kind 'mine'.*: type <class"),
        ("drivers.positioner.kinds.POSITIONERS", "object()", "the positioner 'mine'.*: object <object"),
        ("tactile_lab.slam.exploration.policies.POLICIES", "'quickest'", "the policy 'mine'.*: str 'quickest'"),
        ("tactile_lab.cli.commands.COMMANDS", "3", "the command 'mine'.*: int 3"),
    ],
)
def test_what_is_no_entry_of_the_kind_is_refused_where_it_is_registered(
    written: Written, registry: str, item: str, words: str
) -> None:
    """A class where an instance belongs would else fail far from its file, and for everybody who lists the kinds."""
    module, name = registry.rsplit(".", 1)
    path = written("mine.py", f"from {module} import {name}\n{name}.register('mine', {item})\n")
    with pytest.raises(ConfigurationError, match=rf"mine\.py: registers as {words}.*extending\.md"):
        load_extension(path)
    assert str(path) not in os.environ.get(VARIABLE, "")


def test_a_file_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"absent\.py: no such extension"):
        load_extension(tmp_path / "absent.py")


def test_started_processes_know_the_extensions(written: Written) -> None:
    path = written("mine.py", REGISTER.format(name="mine", item="object"))
    load_extension(path)
    told = "from drivers.core.extensions import load_named_extensions as load; load(); "
    asked = "from tactile_lab.slam.exploration.policies import POLICIES; print(POLICIES.file('mine'))"
    done = subprocess.run([sys.executable, "-c", told + asked], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == str(path)
    load_named_extensions()  # those that are loaded already are left alone


def test_the_kinds_of_fingertips_are_known() -> None:
    assert list(FINGERTIPS) == ["nano17", "biotac"]


@pytest.mark.parametrize(
    ("named", "words"),
    [
        (["absent.py"], r"absent\.py: no such extension"),
        ("mine.py", r"rig\.yaml: extensions: must be a list of files"),
        ([1], r"rig\.yaml: extensions: must be a list of files"),
    ],
)
def test_a_rig_file_that_names_extensions_wrongly(tmp_path: Path, named: object, words: str) -> None:
    path = low_rig(tmp_path)
    path.write_text(yaml.safe_dump({**yaml.safe_load(path.read_text()), "extensions": named}))
    with pytest.raises(ConfigurationError, match=words):
        load_rig(str(path))


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("fingertips", r"fingertips: there is no fingertip kind 'clay'. Fingertip kinds are nano17, biotac"),
        ("positioner", r"positioner: there is no positioner 'clay'. Positioners are six-axis"),
    ],
)
def test_a_rig_file_that_names_a_kind_that_nobody_registered(tmp_path: Path, key: str, words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        load_rig(str(low_rig(tmp_path, {key: "clay"})))


def test_a_kind_of_fingertip_cannot_have_the_name_of_another_key(written: Written, tmp_path: Path) -> None:
    text = "from drivers.fingertips.nano17 import Nano17Kind\nfrom drivers.fingertips.kinds import FINGERTIPS\n"
    written("mine.py", text + "FINGERTIPS.register('hand', Nano17Kind())\n")
    rig = low_rig(tmp_path, {"extensions": ["mine.py"], "fingertips": "hand"})
    with pytest.raises(ConfigurationError, match=r"mine\.py: the fingertip kind 'hand' has the name of another key"):
        load_rig(str(rig))


def test_recordings_of_the_form_before_are_read(tmp_path: Path) -> None:
    """They hold settings of Nano17s whatever the fingertips are, and name neither positioner nor extensions."""
    content = load_rig("sim-biotac").plain()
    recorded = {key: value for key, value in content.items() if key not in {"positioner", "extensions", "biotac"}}
    described = describe({**recorded, "nano17": {"silent_ms": 50.0}}, where="session.yaml")
    assert described.positioner == "six-axis"
    assert described.fingertip_settings == BioTacSettings()
