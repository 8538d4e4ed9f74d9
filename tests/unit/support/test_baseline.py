"""Stored numbers: what counts as moved, what a person is told, and how they are stored anew."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.support import baseline
from tests.support.baseline import assert_baseline, differences

VALUES = {"pose": np.array([0.1, -2.0]), "choice": "left", "count": np.int64(3), "open": {"b", "a"}, "none": None}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the numbers, with VALUES stored in it."""
    monkeypatch.setattr(baseline, "FOLDER", tmp_path)
    monkeypatch.delenv("BASELINE_SHARE", raising=False)
    monkeypatch.setenv("MAKE_BASELINES", "yes")
    assert_baseline("part/numbers", VALUES)
    monkeypatch.delenv("MAKE_BASELINES")
    return tmp_path


def test_what_was_stored_is_accepted() -> None:
    assert_baseline("part/numbers", VALUES)
    assert_baseline("part/numbers", VALUES | {"pose": [0.1 + 1e-9, -2.000001]})


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"pose": [0.1, -2.1]}, r"pose\[1\]: -2 stored, -2.1 now \(-0.1\)"),
        ({"pose": [0.1]}, r"pose: \[0.1, -2.0\] stored, \[0.1\] now"),
        ({"pose": [np.nan, -2.0]}, r"pose\[0\]: 0.1 stored, nan now"),
        ({"choice": "right"}, "choice: left stored, right now"),
        ({"count": 4}, "count: 3 stored, 4 now"),
        ({"count": 3.0}, "count: 3 stored, 3.0 now"),
        ({"more": 1}, "more: nothing stored, 1 now"),
        ({"none": False}, "none: None stored, False now"),
    ],
)
def test_any_other_value_is_told(change: dict[str, object], told: str) -> None:
    with pytest.raises(pytest.fail.Exception, match=told) as failure:
        assert_baseline("part/numbers", VALUES | change)
    assert "python -m tests.support.baseline" in str(failure.value)


def test_a_value_that_is_gone_is_told() -> None:
    with pytest.raises(pytest.fail.Exception, match="choice: left stored, nothing now"):
        assert_baseline("part/numbers", {key: value for key, value in VALUES.items() if key != "choice"})


def test_what_was_never_stored_fails() -> None:
    with pytest.raises(pytest.fail.Exception, match="pose: nothing stored"):
        assert_baseline("part/others", VALUES)


def test_tolerances_are_those_given() -> None:
    wide = VALUES | {"pose": [0.1, -2.1]}
    assert_baseline("part/numbers", wide, atol=0.11)
    assert_baseline("part/numbers", wide, rtol=0.051)
    with pytest.raises(pytest.fail.Exception):
        assert_baseline("part/numbers", wide, rtol=0.049)


def test_many_differences_are_counted_and_some_shown() -> None:
    with pytest.raises(pytest.fail.Exception, match="and 18 more"):
        assert_baseline("part/rows", {str(number): number for number in range(30)})


def test_new_numbers_replace_those_outside_the_tolerance_only(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = folder / "part" / "numbers.json"
    monkeypatch.setenv("MAKE_BASELINES", "yes")
    assert_baseline("part/numbers", VALUES | {"pose": [0.1 + 1e-9, -2.0]})
    assert json.loads(file.read_text())["pose"] == [0.1, -2.0]
    assert_baseline("part/numbers", VALUES | {"pose": [0.2, -2.0]})
    assert json.loads(file.read_text())["pose"] == [0.2, -2.0]


def test_values_without_bounds_are_compared_too() -> None:
    assert not list(differences({"a": float("inf"), "b": float("nan")}, {"a": float("inf"), "b": float("nan")}))
    assert list(differences(float("inf"), 1.0))
