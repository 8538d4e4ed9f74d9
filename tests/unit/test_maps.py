"""The maps of the documentation: what they name is there, and the ways through the code are as short as they say."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import pytest

from tests.support.package_picture import PICTURE, import_counts, svg

REPOSITORY = Path(__file__).resolve().parents[2]
DOCS = REPOSITORY / "docs"
ORDER = ("tactile_lab", "sessions", "calibration", "drivers")
WAYS = ("bytes to report", "decision to palm bytes", "picture to evaluation")


def way(name: str) -> list[str]:
    """The files of a way through the code, in order."""
    text = (DOCS / "architecture.md").read_text()
    begin = text.index(f"<!-- way: {name} -->")
    return re.findall(r"`([\w/]+\.py)`", text[begin:].split("\n#")[0])


@pytest.mark.parametrize("name", WAYS)
def test_a_way_passes_at_most_thirty_files_and_changes_package_four_times(name: str) -> None:
    files = way(name)
    missing = [file for file in files if not (REPOSITORY / file).is_file()]
    assert not missing
    assert 5 < len(files) <= 30
    packages = [file.partition("/")[0] for file in files]
    assert sum(one != other for one, other in pairwise(packages)) <= 4


@pytest.mark.parametrize("page", ["architecture.md", "glossary.md"])
def test_files_and_folders_that_a_map_names_are_there(page: str) -> None:
    named = re.findall(r"`((?:tactile_lab|sessions|calibration|drivers)/[\w/]+(?:\.py)?)`", (DOCS / page).read_text())
    assert named
    assert not [name for name in named if not (REPOSITORY / name).exists()]


def test_terms_of_the_glossary_stand_once_and_in_order() -> None:
    terms = re.findall(r"^\| \*\*(.+?)\*\*", (DOCS / "glossary.md").read_text(), re.MULTILINE)
    assert len(terms) > 50
    assert terms == sorted(set(terms), key=str.lower)


def test_packages_import_downwards_only_and_the_picture_says_so() -> None:
    assert all(ORDER.index(one) < ORDER.index(other) for one, other in import_counts())
    assert PICTURE.read_text() == svg(), "python -m tests.support.package_picture draws it anew"
