"""Hostile files through the command line: a few; all of them by ``python -m tests.support.hostile_table``."""

from __future__ import annotations

import pytest

from tests.support.hostile.case import Case
from tests.support.hostile.shapes import shape_cases
from tests.support.hostile.texts import text_cases

CHOSEN = [
    ("rig file", "a number to the base of 60"),
    ("rig file", "a hexadecimal number of 900 kB"),
    ("rig file", "aliases of aliases"),
    ("contact log", "16 MB of closed brackets"),
    ("contact log", "places of 1e308 m"),
    ("presses", "15 MB of equal samples"),
    ("sensor calibration", "entities of entities"),
    ("mesh", "330 000 triangles"),
    ("mesh", "an accessor of a billion zeros"),
    ("mesh", "a buffer that is a pipe"),
    ("mesh", "a buffer that is another file"),
    ("mesh", "materials that are a pipe"),
    ("mesh", "two million lines"),
    ("pictures", "a picture that is a pipe"),
]


@pytest.fixture(scope="module")
def cases() -> dict[tuple[str, str], Case]:
    """All of them, made for this module alone: it takes two seconds."""
    return {(case.kind, case.name): case for case in [*text_cases(), *shape_cases()]}


@pytest.mark.parametrize(("kind", "name"), CHOSEN)
def test_a_hostile_file_is_refused_in_words(inside, cases, kind, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    case = cases[kind, name]
    answer = inside(*case.command(case.write(tmp_path)))
    assert answer.code == 2
    assert "error: " in answer.err
