"""The sessions of a sweep as cells of the runner: kept as soon as they are finished, resumed where they stopped."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tactile_lab.evaluation.sweep import SweepRow, SweepRun
from tactile_lab.experiments.cells import Cell, Row
from tactile_lab.workflow.sweeping import run_for_sweep


def cell_of(run: SweepRun, rig: str, method: str, grasps: int, check_replay: bool) -> Cell:
    """All that a run depends on, so that a sweep with other settings takes none of another's results."""
    setting = (
        ("object", run.object_name),
        ("dimension", run.dimension),
        ("rig", rig),
        ("method", method),
        ("grasps", grasps),
        ("check_replay", int(check_replay)),
    )
    return Cell(setting, run.seed)


def run_sweep_cell(cell: Cell, root: Path) -> dict[str, Any]:
    """One session, see :func:`tactile_lab.workflow.sweeping.run_for_sweep`. Raises TactileLabError."""
    return run_for_sweep(
        _run(cell),
        rig=cell["rig"],
        method=cell["method"],
        grasps=cell["grasps"],
        root=root,
        check_replay=bool(cell["check_replay"]),
    )


def row_of(row: Row) -> SweepRow:
    """What came of a cell, as a row of the sweep's table."""
    return SweepRow(_run(row.cell), row.figures, row.problem)


def _run(cell: Cell) -> SweepRun:
    return SweepRun(cell["object"], cell["dimension"], cell.seed)
