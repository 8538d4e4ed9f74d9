"""Sweeps on the experiments' runner: resumed, and told what killed a worker."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import pytest

from drivers.core.errors import DeviceError, SessionError
from tactile_lab.cli.running import sweep_cells
from tactile_lab.cli.running.sweep_cells import cell_of, row_of, run_sweep_cell
from tactile_lab.evaluation.sweep import SweepRun, planned_runs
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.runner import RunnerSettings, run_cells
from tests.support.dying_work import die_at_four

RUNS = planned_runs(["box"], [2], [1, 2, 3])


def cells(grasps: int = 16) -> list[Cell]:
    return [cell_of(run, "sim", "joint", grasps, False) for run in RUNS]


def test_a_sweep_goes_on_behind_its_finished_sessions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[int] = []

    def session(run: SweepRun, *, grasps: int, **asked: object) -> dict[str, Any]:
        begun.append(run.seed)
        if run.seed == 2:
            raise DeviceError("object left the table", where="sim")
        if run.seed == 3 and len(begun) == 3:
            raise KeyboardInterrupt
        return {"status": "ok", "grasps": grasps}

    monkeypatch.setattr(sweep_cells, "run_for_sweep", session)
    file, work = tmp_path / "runs.jsonl", partial(run_sweep_cell, root=tmp_path)
    with pytest.raises(KeyboardInterrupt):
        run_cells("sweep", cells(), work, file)
    rows = [row_of(row) for row in run_cells("sweep", cells(), work, file)]
    assert begun == [1, 2, 3, 3]
    assert [row.run for row in rows] == RUNS
    assert [row.problem for row in rows] == ["", "sim: object left the table", ""]
    again = run_cells("sweep", cells(grasps=4), work, file)  # other settings are other runs
    assert [row.figures and row.figures["grasps"] for row in again] == [4, None, 4]


def test_a_killed_worker_is_told_with_its_run_and_finished_runs_are_kept(tmp_path: Path) -> None:
    planned, file = [Cell((("object", "box"),), seed) for seed in (1, 2, 3, 4)], tmp_path / "runs.jsonl"
    with pytest.raises(SessionError, match=r"killed by SIGKILL at box, seed 4.*resumes"):
        run_cells("sweep", planned, partial(die_at_four, rows=file), file, RunnerSettings(jobs=2))
    kept = file.read_text()
    assert all(f'"seed": {seed}' in kept for seed in (1, 2, 3))
    assert '"seed": 4' not in kept
