"""Warnings about results that should not be trusted without checking."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from tactile_lab.evaluation.result_warnings import result_warnings

AROUND = SimpleNamespace(normals_world=np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]))


def warnings(**changed: Any) -> tuple[str, ...]:
    usual = {
        "status": "complete",
        "slam": {"steps": [{"verdict": "tracked"}] * 3},
        "contacts": [AROUND] * 3,
        "sigma_quantiles_m": np.array([0.001, 0.002]),
        "known_share": 0.95,
    }
    return result_warnings(SimpleNamespace(**usual | changed))  # type: ignore[arg-type]


def test_a_good_result_has_no_warning() -> None:
    assert warnings() == ()


def test_a_guessed_part_is_said_with_its_share() -> None:
    assert warnings(known_share=0.7) == ("30% of the shape is a guess: nothing was touched near it",)


def test_results_without_a_known_share_are_judged_by_their_deviations() -> None:
    quantiles_m = np.array([0.001, 0.001, 0.001, 0.5])
    (said,) = warnings(known_share=None, sigma_quantiles_m=quantiles_m)
    assert said.startswith("25% of the shape is a guess")


def test_a_lost_object_an_open_shape_and_a_single_side_are_said() -> None:
    steps = [{"verdict": "first"}, {"verdict": "untracked"}, {"verdict": "untracked"}]
    one_side = SimpleNamespace(normals_world=np.array([[1.0, 0, 0], [0.9, 0.1, 0]]))
    said = warnings(status="lost", slam={"steps": steps}, contacts=[one_side] * 3, sigma_quantiles_m=None)
    assert said[0] == "the object is lost: 2 of 3 grasps could not be registered"
    assert "only one side" in said[1]
    assert said[2].startswith("no closed shape")


def test_warnings_and_doubts_of_the_estimation_are_repeated() -> None:
    slam = {"steps": [], "warnings": ["the model failed"], "doubts": [{"words": "was it moved?"}]}
    assert warnings(slam=slam) == ("the model failed", "was it moved?")
