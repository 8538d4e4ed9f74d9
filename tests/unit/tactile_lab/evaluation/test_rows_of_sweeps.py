"""Why a session of a sweep counts as failed, and how its row reads."""

from __future__ import annotations

from typing import Any

import pytest

from tactile_lab.evaluation.sweep import SweepRow, SweepRun

RUN = SweepRun("box", 2, 7)
GOOD: dict[str, Any] = {
    "status": "ok",
    "failed": False,
    "shape_best_fit": {"hausdorff_mm": 3.26},
    "pose": {"rmse_mm": 1.5},
}


@pytest.mark.parametrize(
    ("evaluation", "failure"),
    [
        (GOOD, ""),
        (None, "no evaluation"),
        (GOOD | {"ended_early": "by a fault"}, "ended by a fault"),
        (GOOD | {"status": "lost"}, "object lost"),
        (GOOD | {"failed": True}, "registration above 5 mm"),
        (GOOD | {"shape_best_fit": None}, "no shape"),
    ],
)
def test_each_reason_is_told(evaluation: dict[str, Any] | None, failure: str) -> None:
    row = SweepRow(RUN, evaluation)
    assert row.failure == failure
    assert row.as_json()["failure"] == (failure or None)
    if failure:
        assert row.line() == f"box, 2-D, seed 7: failed, {failure}"


def test_a_problem_is_told_in_its_own_words() -> None:
    assert SweepRow(RUN, None, "the table fell").failure == "the table fell"


def test_a_good_row_has_its_figures_and_a_mark_for_what_is_not_known() -> None:
    assert SweepRow(RUN, GOOD).line() == "box, 2-D, seed 7: Hausdorff 3.3 mm at best fit, position 1.5 mm"
    assert "position 1.5 mm" not in SweepRow(RUN, GOOD | {"pose": None}).line()
