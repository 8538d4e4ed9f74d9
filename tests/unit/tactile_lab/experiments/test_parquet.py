"""Runs as a Parquet table, and the runs of several machines in one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from pyarrow import parquet

from drivers.core.errors import ConfigurationError, WriteError
from tactile_lab.experiments.cells import Cell, Row
from tactile_lab.experiments.execution.source_version import version
from tactile_lab.experiments.parquet import write_parquet
from tactile_lab.experiments.runner import RunnerSettings, run_cells
from tests.support import cluster_work

ROWS = [
    Row(Cell((("object", "box"), ("noise", 50)), 3), {"shape": {"hausdorff_mm": 1, "ok": True}, "curve": [1.0, 2.0]}),
    Row(Cell((("object", "box"), ("noise", 50)), 4), {"shape": {"hausdorff_mm": 1.5, "ok": False}, "status": "ok"}),
    Row(Cell((("object", "box"), ("noise", 50)), 5), None, "nothing fits"),
]


def test_every_run_is_a_row_with_its_setting_and_figures(tmp_path: Path) -> None:
    file = tmp_path / "new" / "runs.parquet"
    write_parquet(file, "test", ROWS)
    table = parquet.read_table(file)
    columns = table.to_pydict()
    assert columns == {
        "object": ["box"] * 3,
        "noise": [50] * 3,
        "seed": [3, 4, 5],
        "failure": ["", "", "nothing fits"],
        "shape.hausdorff_mm": [1.0, 1.5, None],
        "shape.ok": [True, False, None],
        "status": [None, "ok", None],
    }
    assert table.schema.metadata[b"experiment"] == b"test"
    assert table.schema.metadata[b"version"] == version().encode()
    assert [path.name for path in file.parent.iterdir()] == ["runs.parquet"]


def test_a_table_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteError, match="--parquet"):
        write_parquet(tmp_path / "file" / "runs.parquet", "test", ROWS)


def test_runs_of_another_machine_are_taken_over(tmp_path: Path) -> None:
    cells = [Cell((("noise", 25),), seed) for seed in range(4)]
    there, here = tmp_path / "there.jsonl", tmp_path / "here.jsonl"
    run_cells("test", cells[2:], cluster_work.square, there)
    made: list[Row] = []
    settings = RunnerSettings(others=(there,))
    rows = run_cells("test", cells, cluster_work.square, here, settings, lambda row, *_: made.append(row))
    assert [row.cell for row in made] == cells[:2]
    assert rows == run_cells("test", cells, cluster_work.square, tmp_path / "alone.jsonl")
    assert run_cells("test", cells, cluster_work.square, here) == rows  # it keeps them


def test_runs_of_another_machine_have_to_be_of_this_version(tmp_path: Path) -> None:
    there, cells = tmp_path / "there.jsonl", [Cell((("noise", 25),), 1)]
    with pytest.raises(ConfigurationError, match="no results here"):
        run_cells("test", cells, cluster_work.square, tmp_path / "here.jsonl", RunnerSettings(others=(there,)))
    run_cells("test", cells, cluster_work.square, there)
    head, *lines = there.read_text().splitlines()
    there.write_text("\n".join([json.dumps({**json.loads(head), "version": "older"}), *lines]) + "\n")
    with pytest.raises(ConfigurationError, match="made by another version"):
        run_cells("test", cells, cluster_work.square, tmp_path / "here.jsonl", RunnerSettings(others=(there,)))
