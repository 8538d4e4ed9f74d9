"""Results as JSON: what each type becomes, and files that hold none."""

from __future__ import annotations

import os
from dataclasses import dataclass
from enum import Enum, IntEnum
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gtsam import Pose2, Pose3
from pydantic import BaseModel

from drivers.core.errors import SessionDataError
from tactile_lab.evaluation.files.plain import json_text, plain, read_json_object


class Colour(Enum):
    RED = "red"


class Level(IntEnum):
    HIGH = 3


class Settings(BaseModel):
    folder: Path = Path("a/b")
    limit: float = 0.5


@dataclass(frozen=True)
class Figure:
    mm: float
    colour: Colour


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (None, None),
        (True, True),
        (3, 3),
        (Level.HIGH, 3),
        (0.5, 0.5),
        (float("nan"), None),
        (float("-inf"), None),
        ((1, "a"), [1, "a"]),
        ({3, 1, 2}, [1, 2, 3]),
        (frozenset({"b", "a"}), ["a", "b"]),
        ({1: {"x": (2.0,)}}, {"1": {"x": [2.0]}}),
        (np.array([[1.0, np.nan], [np.inf, 2.0]]), [[1.0, None], [None, 2.0]]),
        (np.float64(0.25), 0.25),
        (np.int64(4), 4),
        (Pose2(1.0, 2.0, 0.0), [[1.0, 0.0, 1.0], [0.0, 1.0, 2.0], [0.0, 0.0, 1.0]]),
        (Pose3(), np.eye(4).tolist()),
        (Path("a/b"), "a/b"),
        (Colour.RED, "red"),
        (Settings(), {"folder": "a/b", "limit": 0.5}),
        (Figure(1.5, Colour.RED), {"mm": 1.5, "colour": "red"}),
    ],
)
def test_every_type_of_a_result_becomes_plain_data(value: Any, expected: Any) -> None:
    found = plain(value)
    assert found == expected
    assert isinstance(found, type(expected))


def test_text_is_indented_keeps_letters_and_ends_with_a_line_feed() -> None:
    assert json_text({"name": "Würfel", "mm": (1.0, float("nan"))}) == (
        '{\n "name": "Würfel",\n "mm": [\n  1.0,\n  null\n ]\n}\n'
    )


@pytest.mark.parametrize(
    ("content", "words"),
    [("[1]", "does not contain a JSON object"), ("{", "is not readable JSON"), (None, "not found")],
)
def test_a_file_without_an_object_is_refused_with_what_to_do(tmp_path: Path, content: str | None, words: str) -> None:
    path = tmp_path / "slam.json"
    if content is not None:
        path.write_text(content)
    with pytest.raises(SessionDataError, match=words) as caught:
        read_json_object(path, hint="Replay the session")
    assert (caught.value.where, caught.value.hint) == (str(path), "Replay the session")


def test_what_is_no_plain_file_is_refused_with_what_to_do(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for name in ("pipe", "."):
        with pytest.raises(SessionDataError) as caught:
            read_json_object(tmp_path / name, hint="Replay the session")
        assert caught.value.hint == "Replay the session"
