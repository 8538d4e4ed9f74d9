"""Sessions on a cluster with a worker and the client killed: the study's rows are those of one process."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tactile_lab.experiments.runner import kept_rows, run_cells
from tests.support.cluster_table import NAME, cells_of, killed_on_the_way, same_rows
from tests.support.measured_runs import measured

SESSIONS = 16


def test_tables_differ_by_figures_but_not_by_what_was_measured(tmp_path: Path) -> None:
    (row,) = run_cells(NAME, cells_of(1, "odometry"), measured, tmp_path / "one.jsonl")
    assert row.figures is not None
    elsewhere = replace(row, figures={**row.figures, "process": 1, "cpu_s": 9.0, "resident_MB": 1.0, "finish_ms": 0.0})
    assert same_rows([row], [elsewhere])
    assert not same_rows([row], [replace(row, figures={**row.figures, "mean_mm": 0.0})])
    assert not same_rows([row], [])


@pytest.mark.long
def test_a_killed_worker_and_a_killed_client_change_no_row(tmp_path: Path) -> None:
    cells = cells_of(SESSIONS, "odometry")
    alone = run_cells(NAME, cells, measured, tmp_path / "alone.jsonl")
    arguments = ["--sessions", str(SESSIONS), "--method", "odometry", "--out", str(tmp_path)]
    killed_on_the_way(cells, arguments, tmp_path)
    made = {row.cell.key: row for row in kept_rows(NAME, tmp_path / "cluster.jsonl")}
    assert same_rows(alone, [made[cell.key] for cell in cells])
