"""Mutations of a small tree: which there are, which tests are near, and what becomes of each."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from coverage import CoverageData

from tests.mutants.__main__ import Choice
from tests.mutants.covering import Covering
from tests.mutants.mutations import AREAS, Mutation, draw, means_something_else, mutations_of
from tests.mutants.nearest import Nearest
from tests.mutants.trial import Copy

SOURCE = '''"""A module of 3 lines."""
from dataclasses import dataclass


@dataclass(frozen=True)
class Reading:
    value: float = 2.5


def clamp(value: float, low: int = 0) -> float:
    """At least 0."""
    if value is None:
        return low
    if not value > low:
        return low
    return min(value, 1000) * 2


def count_up(limit: int) -> int:
    number = 0
    while number < limit:
        number += 1
    return number
'''
TESTS = """import pytest
from drivers.clamping import clamp, count_up

def test_of_its_own_that_is_broken():
    assert False

def test_high():
    assert clamp(5.0) == 10.0

def test_missing():
    assert clamp(None) == 0

def test_counts():
    assert count_up(3) == 3
"""


def after(kind: str, source: str = SOURCE) -> set[str]:
    return {mutation.after.strip() for mutation in mutations_of("drivers/clamping.py", source) if mutation.kind == kind}


def mutation(before: str, changed: str) -> Mutation:
    return Mutation("drivers/clamping.py", 1, "by hand", before + "\n", changed + "\n")


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A repository with one module that does something in each area, and tests at different distances."""
    root = tmp_path / "tree"
    files = {f"{folder}/clamping.py": SOURCE for folder in AREAS.values()} | {
        "drivers/user.py": "import importlib\n\nimportlib.import_module(f'drivers.{chr(99)}lamping')\n",
        "tests/unit/test_clamping.py": TESTS,
        "tests/unit/test_a_user.py": "import drivers.user\n\ndef test_it(): pass\n",
        "tests/unit/test_direct.py": "def test_it():\n    import drivers.clamping\n",
        "tests/system/test_clamping_at_length.py": "from drivers import clamping\n\ndef test_it(): pass\n",
        "tests/unit/test_other.py": "import json\n\ndef test_it(): pass\n",
    }
    for path, text in files.items():
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).write_text(text)
    subprocess.run(["git", "init", "--quiet", str(root)], check=True)
    return root


@pytest.fixture
def copy(tree: Path, tmp_path: Path) -> Iterator[Copy]:
    copy = Copy(tree, tmp_path / "copy", patience_s=1.0, libraries=("hypothesis",))
    yield copy
    copy.close()


def test_each_kind_of_mutation_is_found() -> None:
    assert after("is None") == {"if value is not None:"}
    assert after("comparison") == {
        "if not value >= low:", "if not value <= low:", "while number <= limit:", "while number >= limit:"
    }  # fmt: skip
    assert after("arithmetic") == {"return min(value, 1000) / 2", "number -= 1"}
    assert after("unit factor") == {"return min(value, 1) * 2"}
    assert after("min and max") == {"return max(value, 1000) * 2"}
    assert after("not") == {"if value > low:"}
    assert after("constant") == {"value: float = 5.0"}
    assert after("early return") == {"pass"}
    assert after("removed statement") == {"pass"}
    assert {"def clamp(value: float, low: int = 1) -> float:", "number += 2"} <= after("off by one")


def test_what_is_no_behaviour_is_left_alone() -> None:
    text = "from typing import TYPE_CHECKING\n\nif TYPE_CHECKING:\n    N = 3\n\npairs = zip('a', 'b', strict=True)\n"
    assert list(mutations_of("x.py", text)) == []
    assert not any(
        "dataclass" in changed or "A module" in changed for kind in ("boolean", "constant") for changed in after(kind)
    )


def test_a_mutation_finds_its_lines_after_they_moved_and_says_when_they_are_gone() -> None:
    change = mutation("    number = 0", "    number = 1")
    assert change.applied("\n\n" + SOURCE) == "\n\n" + SOURCE.replace("number = 0", "number = 1")
    with pytest.raises(ValueError, match="no such lines"):
        change.applied("x = 1\n")


def test_a_draw_is_even_over_the_areas_and_the_same_for_the_same_seed(tree: Path) -> None:
    drawn = draw(tree, 12, seed=3)
    assert [change.area for change in drawn] == [*AREAS] * 2
    assert drawn == draw(tree, 12, seed=3)
    assert drawn != draw(tree, 12, seed=4)
    assert all(means_something_else(tree, change) for change in drawn)
    assert len({(change.path, change.line) for change in drawn}) == 12


def test_the_nearest_tests_come_first(tree: Path) -> None:
    assert Nearest(tree).tests("drivers/clamping.py") == [
        "tests/unit/test_clamping.py",
        "tests/unit/test_direct.py",
        "tests/unit/test_a_user.py",
        "tests/system/test_clamping_at_length.py",
    ]


@pytest.mark.long
def test_mutations_are_killed_survive_or_never_end_and_the_tree_stays_as_it_is(tree: Path, copy: Copy) -> None:
    tests = Nearest(tree).tests("drivers/clamping.py")
    killed = copy.verdict(mutation("    return min(value, 1000) * 2", "    return min(value, 1000) / 2"), tests, 60.0)
    assert (killed.outcome, killed.by) == ("killed", "tests/unit/test_clamping.py::test_high")
    assert copy.distrusted == {"tests/unit/test_clamping.py::test_of_its_own_that_is_broken"}
    survived = copy.verdict(mutation("    if not value > low:", "    if not value >= low:"), tests, 60.0)
    assert (survived.outcome, survived.dead) == ("survived", False)
    endless = copy.verdict(mutation("        number += 1", "        number += 0"), tests, 2.0)
    assert (endless.outcome, endless.dead) == ("timeout", True)
    broken = copy.verdict(mutation("def count_up(limit: int) -> int:", "def counted(limit: int) -> int:"), tests, 60.0)
    assert (broken.outcome, broken.by) == ("killed", "tests/unit/test_clamping.py")
    assert (tree / "drivers/clamping.py").read_text() == (copy.folder / "drivers/clamping.py").read_text() == SOURCE


def test_a_mutation_that_no_test_reaches_survives(copy: Copy) -> None:
    assert copy.verdict(mutation("    number = 0", "    number = 1"), [], 60.0).outcome == "survived"


def test_tests_that_run_a_line_are_asked_before_the_nearest_files(tree: Path, tmp_path: Path) -> None:
    pytest_words = [sys.executable, "-m", "pytest", "-q", "tests/unit/test_clamping.py", "-p", "no:cacheprovider"]
    cov = ["--cov=drivers", "--cov-context=test", "--cov-report="]
    environment = os.environ | {"COVERAGE_FILE": str(tmp_path / "covered"), "PYTHONPATH": str(tree)}
    subprocess.run([*pytest_words, *cov], cwd=tree, env=environment, capture_output=True)
    choice = Choice(Nearest(tree), Covering(tree, tmp_path / "covered"), files=1)

    low = mutation("        return low", "        return -low")
    line = SOURCE.splitlines().index("    if not value > low:") + 1
    assert choice.tests(replace(low, line=line)) == ["tests/unit/test_clamping.py::test_high"]
    imported = replace(low, line=SOURCE.splitlines().index("    value: float = 2.5") + 1)
    clamped, at_length = "tests/unit/test_clamping.py", "tests/system/test_clamping_at_length.py"
    users = [f"{clamped}::test_counts", f"{clamped}::test_high", f"{clamped}::test_missing"]
    assert choice.tests(imported) == [*users, at_length]
    assert replace(choice, files=2).tests(imported) == [*users, "tests/unit/test_direct.py", at_length]
    unknown = Choice(Nearest(tree), None, files=1)
    assert unknown.tests(imported) == [clamped]


def test_what_a_module_defines_is_tried_first_on_tests_that_import_all_of_a_package(tree: Path) -> None:
    walker = tree / "tests/unit/test_everything.py"
    by_place = "importlib.import_module({})".format('".".join(f.parts)')
    walker.write_text(f"def test_all(): [{by_place} for f in FILES]\n")
    choice = Choice(Nearest(tree), None, files=1)
    lines = SOURCE.splitlines()
    default = replace(mutation("    value: float = 2.5", "    value: float = 5.0"))
    assert choice.tests(replace(default, line=lines.index("    value: float = 2.5") + 1)) == [
        "tests/unit/test_everything.py",
        "tests/unit/test_clamping.py",
    ]
    inside = replace(default, line=lines.index("    number = 0") + 1)
    assert choice.tests(inside) == ["tests/unit/test_clamping.py"]


def test_a_fixtures_lines_are_run_for_its_whole_file(tmp_path: Path) -> None:
    (tmp_path / "drivers.py").write_text("x = 1\n")
    data = CoverageData(str(tmp_path / "covered"))
    for context in ("tests/unit/test_b.py::test_it|run", "tests/unit/test_a.py::test_first|setup"):
        data.set_context(context)
        data.add_lines({str(tmp_path / "drivers.py"): [1]})
    data.write()
    found = Covering(tmp_path, tmp_path / "covered").tests("drivers.py", 1, ["tests/unit/test_b.py"])
    assert found == ["tests/unit/test_b.py::test_it", "tests/unit/test_a.py::test_first", "tests/unit/test_a.py"]


def test_coverage_that_names_no_test_is_refused(tmp_path: Path) -> None:
    CoverageData(str(tmp_path / "covered")).write()
    with pytest.raises(ValueError, match="--cov-context=test"):
        Covering(tmp_path, tmp_path / "covered")
