"""Sweeps of many sessions: spread, failures, Markdown."""

from __future__ import annotations

from typing import Any

import pytest

from tactile_lab.evaluation.spread import Spread
from tactile_lab.evaluation.sweep import SweepRow, SweepRun, markdown_table, planned_runs, summaries


def evaluation(hausdorff_mm: float, *, status: str = "ok", failed: bool | None = False) -> dict[str, Any]:
    figures = {"hausdorff_mm": hausdorff_mm, "mean_distance_mm": hausdorff_mm / 4}
    return {
        "status": status,
        "failed": failed,
        "shape": {**figures, "hausdorff_mm": hausdorff_mm + 1},
        "shape_best_fit": figures,
        "pose": {"rmse_mm": 2.0, "rmse_deg": 1.0},
        "registration_rms_mm": 1.5,
        "consistency": {"surface": {"signed_mm": -0.04, "inside": [0.5, 0.7, 0.93]}},
    }


def test_runs_are_all_combinations_with_seeds_fastest() -> None:
    runs = planned_runs(["box", "cube"], [2], [1, 2])
    assert runs == [SweepRun("box", 2, 1), SweepRun("box", 2, 2), SweepRun("cube", 2, 1), SweepRun("cube", 2, 2)]


def test_spread_is_median_p90_and_maximum_of_what_is_known() -> None:
    spread = Spread.of_known([1.0, None, 2.0, 3.0, 11.0])
    assert spread is not None
    assert (spread.median, spread.largest) == (2.5, 11.0)
    assert spread.text() == "2.5 / 8.6 / 11.0"
    assert Spread.of_known([None]) is None


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (evaluation(3.0), ""),
        (evaluation(3.0, status="lost"), "object lost"),
        (evaluation(3.0, failed=True), "registration above 5 mm"),
        ({**evaluation(3.0), "ended_early": "after 3 grasps: stopped"}, "ended after 3 grasps: stopped"),
        ({**evaluation(3.0), "ended_early": ""}, ""),
        ({**evaluation(3.0), "shape_best_fit": None}, "no shape"),
        (None, "no evaluation"),
    ],
)
def test_reason_of_failure_is_said(content: dict[str, Any] | None, reason: str) -> None:
    assert SweepRow(SweepRun("box", 2, 1), content).failure == reason


def test_markdown_shows_failed_runs_with_seed_and_reason_and_counts_their_figures() -> None:
    rows = [
        SweepRow(SweepRun("box", 2, seed), evaluation(value, failed=value > 30))
        for seed, value in enumerate([3.0, 4.0, 40.0], start=1)
    ]
    rows.append(SweepRow(SweepRun("sphere", 3, 1), None, "no | contact\nat all"))
    text = markdown_table(summaries(rows))
    lines = text.splitlines()
    assert len({line.count(" | ") for line in lines}) == 1
    assert "| box | 2 | 3 | 5.0 / 33.8 / 41.0 | 4.0 / 32.8 / 40.0 |" in lines[2]
    assert lines[2].endswith("| 1 | 3: registration above 5 mm |")
    assert "| -0.04 / -0.04 / -0.04 | 0.93 / 0.93 / 0.93 |" in lines[2]
    assert "no \\| contact at all" in lines[3]
