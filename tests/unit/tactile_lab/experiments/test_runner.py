"""Runs of an experiment: resumed, failed, repeated, and the same in any number of processes."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import grimp
import pytest

from drivers.core.errors import ConfigurationError, TrackingError, WriteError
from tactile_lab.experiments import runner
from tactile_lab.experiments.cells import Cell, Row, execute, grid, planned_cells
from tactile_lab.experiments.execution import source_version
from tactile_lab.experiments.runner import RunnerSettings, run_cells
from tactile_lab.experiments.runs.graph_runs import solve_stressed_graph
from tests.support.repository import REPOSITORY

CELLS = planned_cells(grid(shape=["a", "b"], noise=[50, 100]), [3, 4])


def square(cell: Cell) -> dict[str, float]:
    return {"value": float(cell["noise"] * cell.seed)}


class Counting:
    """Counts its runs; some of them fail."""

    def __init__(self, failing: Sequence[int] = ()) -> None:
        self.runs: list[str] = []
        self._failing = failing

    def __call__(self, cell: Cell) -> dict[str, float]:
        self.runs.append(cell.key)
        if cell.seed in self._failing:
            raise TrackingError("nothing fits")
        return square(cell)


def test_every_setting_comes_with_every_seed_before_the_next_seed() -> None:
    assert len(CELLS) == 8
    assert [cell.seed for cell in CELLS] == [3] * 4 + [4] * 4
    assert CELLS[1]["noise"] == 100
    assert len({cell.key for cell in CELLS}) == 8
    assert CELLS[1].words() == "a, 100, seed 3"


def test_rows_survive_the_file_and_come_in_the_order_of_the_cells(tmp_path: Path) -> None:
    file = tmp_path / "new" / "runs.jsonl"
    told: list[tuple[int, int]] = []
    rows = run_cells("test", CELLS, square, file, finished=lambda row, done, total: told.append((done, total)))
    assert [row.cell for row in rows] == CELLS
    assert told[-1] == (8, 8)
    again = run_cells("test", CELLS[::-1], Counting(failing=(3, 4)), file)
    assert again == rows[::-1]


def test_an_experiment_that_was_broken_off_goes_on_where_it_stopped(tmp_path: Path) -> None:
    file, second = tmp_path / "runs.jsonl", Counting()

    def breaks(cell: Cell) -> dict[str, float]:
        if cell == CELLS[5]:
            raise KeyboardInterrupt
        return square(cell)

    with pytest.raises(KeyboardInterrupt):
        run_cells("test", CELLS, breaks, file)
    rows = run_cells("test", CELLS, second, file)
    assert second.runs == [cell.key for cell in CELLS[5:]]
    assert [row.figures for row in rows] == [square(cell) for cell in CELLS]


@pytest.mark.parametrize("figure", [float("inf"), float("nan"), {"deep": [float("inf")]}])
def test_a_figure_that_no_file_holds_costs_its_run_alone(figure: object, tmp_path: Path) -> None:
    file = tmp_path / "runs.jsonl"

    def infinite_once(cell: Cell) -> dict[str, object]:
        return {"value": figure} if cell == CELLS[1] else dict(square(cell))

    rows = run_cells("test", CELLS[:3], infinite_once, file)
    assert [row.figures is None for row in rows] == [False, True, False]
    assert "JSON" in rows[1].problem
    assert run_cells("test", CELLS[:3], Counting(failing=(3, 4)), file) == rows


def test_a_line_that_was_being_written_when_the_program_died_is_run_again(tmp_path: Path) -> None:
    file, second = tmp_path / "runs.jsonl", Counting()
    run_cells("test", CELLS[:3], square, file)
    file.write_text(file.read_text()[:-20])
    run_cells("test", CELLS[:3], second, file)
    assert second.runs == [CELLS[2].key]


def test_errors_and_defects_become_failed_runs_with_their_reason(tmp_path: Path) -> None:
    rows = run_cells("test", CELLS, Counting(failing=(4,)), tmp_path / "runs.jsonl")
    assert [row.failure for row in rows] == [""] * 4 + ["nothing fits"] * 4
    assert execute(CELLS[0], lambda cell: {"value": 1 / 0}).failure == "ZeroDivisionError: division by zero"


def test_a_run_fails_by_registration_status_or_without_a_shape() -> None:
    def failure(**figures: object) -> str:
        return Row(CELLS[0], figures).failure

    assert failure(registration_mm=4.9, hausdorff_mm=30.0, status="ok") == ""
    assert failure(registration_mm=5.1, hausdorff_mm=1.0) == "registration above 5 mm"
    assert failure(registration_mm=1.0, hausdorff_mm=None) == "no shape"
    assert failure(registration_mm=1.0, hausdorff_mm=1.0, status="lost") == "object lost"
    assert failure(registration_mm=1.0, hausdorff_mm=1.0, status="object lost") == "object lost"  # as sweeps say it


def test_results_of_another_version_are_only_kept_when_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "runs.jsonl"
    run_cells("test", CELLS, square, file)
    monkeypatch.setattr(runner, "version", lambda: "another")
    kept = Counting()
    run_cells("test", CELLS, kept, file, RunnerSettings(keep=True))
    assert kept.runs == []
    assert runner.kept_rows("test", file) == []  # of several versions: nobody's
    run_cells("test", CELLS, kept, file, RunnerSettings(keep=True))
    assert kept.runs == []
    monkeypatch.setattr(runner, "version", lambda: "a third")
    renewed = Counting()
    run_cells("test", CELLS, renewed, file)
    assert len(renewed.runs) == 8
    assert [row.cell for row in runner.kept_rows("test", file)] == CELLS


def test_version_covers_every_module_that_experiments_import_but_those_that_draw() -> None:
    graph = grimp.build_graph("tactile_lab", "calibration", "drivers", "sessions", cache_dir=None)
    needed = graph.find_upstream_modules("tactile_lab.experiments", as_package=True)
    needed |= graph.find_descendants("tactile_lab.experiments")
    drawing = ("tactile_lab.report", "tactile_lab.experiments.results", "tactile_lab.experiments.plot")
    computing = {name for name in needed if not name.startswith(drawing)}
    covered = {".".join(file.relative_to(REPOSITORY).with_suffix("").parts) for file in source_version.sources()}
    covered |= {name.removesuffix(".__init__") for name in covered}
    assert {
        "sessions.conductor.conductor",
        "calibration.forearm.placement",
        "drivers.core.transports",
        "tactile_lab.slam.exploration.policy",
    } <= computing
    assert computing - covered == set()


def test_version_covers_the_rigs_descriptions_and_calibrations() -> None:
    names = {file.relative_to(REPOSITORY).as_posix() for file in source_version.sources()}
    assert {
        "tactile_lab/rigs/sim.yaml",
        "tactile_lab/rigs/calibrations/simulated-hand/forearm.yaml",
        "tactile_lab/slam/tactile_slam.py",
    } <= names


def test_version_changes_with_any_source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "sessions" / "conductor.py"
    file.parent.mkdir()
    file.write_text("A = 1\n")
    monkeypatch.setattr(source_version, "_ROOT", tmp_path)
    before = source_version.version.__wrapped__()
    file.write_text("A = 2\n")
    assert source_version.version.__wrapped__() != before


def test_a_file_of_something_else_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "runs.jsonl"
    run_cells("test", CELLS[:1], square, file)
    with pytest.raises(ConfigurationError, match="results of test"):
        run_cells("other", CELLS[:1], square, file)
    file.write_text("hello\n")
    with pytest.raises(ConfigurationError, match="not a results file"):
        run_cells("test", CELLS[:1], square, file)
    (tmp_path / "plain").write_text("")
    with pytest.raises(WriteError, match="cannot be written"):
        run_cells("test", CELLS[:1], square, tmp_path / "plain" / "runs.jsonl")


@pytest.fixture(scope="module")
def in_processes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[Row]]:
    cells = planned_cells(grid(solver=["Cauchy", "ours"]), [5])
    file = tmp_path_factory.mktemp("jobs") / "runs.jsonl"
    yield run_cells("test", cells, solve_stressed_graph, file, RunnerSettings(jobs=2))
    assert len(file.read_text().splitlines()) == 3


def test_results_do_not_depend_on_the_number_of_processes(in_processes: list[Row]) -> None:
    def untimed(row: Row) -> str:
        assert row.figures is not None
        return json.dumps({name: value for name, value in row.figures.items() if name != "ms"})

    alone = [execute(row.cell, solve_stressed_graph) for row in in_processes]
    assert [untimed(row) for row in in_processes] == [untimed(row) for row in alone]
