"""The base of an installation: which packages it brings, and how large they are, as the page about installing says."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable
from importlib.metadata import Distribution, distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

REPOSITORY = Path(__file__).resolve().parents[2]
MiB, MB = 2**20, 10**6
LISTED_MiB = 4.0
MOST_MB = 450
"""Of the files; on a disk each takes whole blocks: 18 MB more."""


def brought_by(requirements: Iterable[str]) -> dict[str, Distribution]:
    """All packages that some requirements bring, with those of those, by name."""
    found: dict[str, Distribution] = {}
    waiting = [Requirement(text) for text in requirements]
    while waiting:
        wanted = waiting.pop()
        name = canonicalize_name(wanted.name)
        if name not in found and (wanted.marker is None or wanted.marker.evaluate({"extra": ""})):
            found[name] = distribution(wanted.name)
            waiting += [Requirement(text) for text in found[name].requires or ()]
    return found


def size_MiB(package: Distribution) -> float:
    """Of the files that were installed; bytecode comes later, and not everywhere."""
    files = [Path(str(package.locate_file(file))) for file in package.files or () if not file.name.endswith(".pyc")]
    return sum(file.stat().st_size for file in files if file.is_file()) / MiB


@pytest.fixture(scope="module")
def base() -> dict[str, float]:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    return {name: size_MiB(package) for name, package in brought_by(project["dependencies"]).items()}


def told() -> dict[str, float]:
    page = (REPOSITORY / "docs/installation.md").read_text()
    rows = re.findall(r"^\| ([a-z0-9-]+) \| (\d+) \| ", page, re.M)
    return {name: float(size) for name, size in rows}


def test_the_base_brings_the_packages_that_the_page_lists(base: dict[str, float]) -> None:
    assert {name for name, size in base.items() if size >= LISTED_MiB} == set(told())
    for name, size in told().items():
        assert base[name] == pytest.approx(size, rel=0.1, abs=1.0), name


def test_the_base_has_no_compiler_and_nothing_of_an_extra(base: dict[str, float]) -> None:
    extras = {"opencv-contrib-python-headless", "numba", "llvmlite", "pillow", "mujoco-core", "pyarrow"}
    assert not {*extras, "scikit-image", "matplotlib"} & set(base)
    assert sum(base.values()) * MiB < (MOST_MB - 18) * MB
