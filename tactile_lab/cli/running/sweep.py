"""``tactile-lab sweep``: many simulated sessions in one table."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_lab.cli.options import (
    LARGEST_SEED,
    MOST_GRASPS,
    MOST_JOBS,
    Json,
    Merge,
    MethodName,
    NoInput,
    ParquetFile,
    RigName,
    Scheduler,
    writable_folder,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tactile_lab.evaluation.sweep import SweepRow, SweepSummary
    from tactile_lab.experiments.cells import Cell, Row


def sweep(
    objects: Annotated[str, typer.Option(help="Comma-separated object names, or 'all'.")] = "all",
    seeds: Annotated[str, typer.Option(help="Comma-separated random seeds.")] = "1,2,3",
    dimensions: Annotated[str, typer.Option(help="Comma-separated dimensions: 2, 3 or 2,3.")] = "2,3",
    method: MethodName = "joint",
    grasps: Annotated[int, typer.Option(min=1, max=MOST_GRASPS, help="Number of grasps per session.")] = 16,
    rig: RigName = "sim",
    jobs: Annotated[int, typer.Option(min=1, max=MOST_JOBS, help="Number of parallel sessions.")] = 2,
    out: Annotated[Path, typer.Option(help="Folder for the sessions and table.md.", callback=writable_folder)] = Path(
        "runs/sweep"
    ),
    check_replay: Annotated[
        bool,
        typer.Option("--check-replay", help="Replay every session; a session whose replay differs counts as failed."),
    ] = False,
    scheduler: Scheduler = "",
    merge: Merge = None,
    parquet: ParquetFile = None,
    store: Annotated[
        bool, typer.Option("--store", help="Store the table in the repository and write its page.")
    ] = False,
    docs: Annotated[Path, typer.Option(help="Documentation folder with the stored results and pages.")] = Path("docs"),
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Run a simulated session for every object, seed and dimension, and tabulate errors and failures.

    Started again, a sweep that was interrupted, or whose worker was killed, resumes after its finished runs.
    """
    from tactile_lab.cli.running.sweep_cells import cell_of, row_of
    from tactile_lab.evaluation.sweep import planned_runs, summaries
    from tactile_lab.experiments.parquet import write_parquet
    from tactile_lab.workflow.sweeping import check_sweep

    del no_input
    if store and (rig != "sim" or dimensions not in _STORED):
        raise typer.BadParameter("stored are tables of the rig sim in one dimension", param_hint="'--store'")
    names = None if objects == "all" else tuple(name.strip() for name in objects.split(","))
    chosen = _numbers(dimensions, "--dimensions", smallest=2, largest=3)
    drawn = _numbers(seeds, "--seeds", largest=LARGEST_SEED)
    runs = planned_runs(check_sweep(rig, names, out, method), chosen, drawn)
    cells = [cell_of(run, rig, method, grasps, check_replay) for run in runs]
    done = _run(cells, out, jobs, scheduler, merge or [])
    rows = [row_of(row) for row in done]
    found = summaries(rows)
    _tell(rows, found, out, as_json)
    if parquet is not None:
        write_parquet(parquet, "sweep", done)
    if store:
        command = f"tactile-lab sweep --objects {objects} --seeds {seeds} --dimensions {dimensions}"
        command += f" --method {method} --grasps {grasps}"
        _store(docs, *_STORED[dimensions], command, found)
    if any(row.evaluation is None for row in rows):
        raise typer.Exit(1 if all(row.evaluation is None for row in rows) else 3)


def _run(cells: Sequence[Cell], out: Path, jobs: int, scheduler: str, merged: Sequence[Path]) -> list[Row]:
    """The sessions, those that are finished already in the folder or in a merged one left out."""
    from functools import partial

    from tactile_lab.cli.console import say
    from tactile_lab.cli.running.sweep_cells import row_of, run_sweep_cell
    from tactile_lab.experiments.runner import LINES_FILE, RunnerSettings, run_cells

    folder = out.resolve()  # for workers, which stand elsewhere
    others = tuple(each / LINES_FILE for each in merged)
    settings = RunnerSettings(jobs, scheduler=scheduler, shared=folder, others=others)
    work = partial(run_sweep_cell, root=folder if scheduler else out)
    return run_cells("sweep", cells, work, out / LINES_FILE, settings, lambda row, *_: say(row_of(row).line()))


def _tell(rows: Sequence[SweepRow], found: Sequence[SweepSummary], out: Path, as_json: bool) -> None:
    from drivers.core.atomic_files import write_whole
    from tactile_lab.cli.console import answer, emit_json, show_table
    from tactile_lab.evaluation.sweep import markdown_table, summary_cells, summary_titles

    if as_json:
        emit_json([row.as_json() for row in rows])
    else:
        show_table("Median / 90th percentile / maximum", summary_titles(), map(summary_cells, found))
    write_whole(out / "table.md", markdown_table(found))
    answer(f"table  {out / 'table.md'}")


_STORED = {
    "2": ("rig-contour", "Autonomous sessions on the simulated rig, contour (2-D)."),
    "3": ("rig-surface", "Autonomous sessions on the simulated rig, surface (3-D)."),
}
"""Stored results by the dimension: name and what it shows."""


def _store(docs: Path, name: str, sentence: str, command: str, found: Sequence[SweepSummary]) -> None:
    """Store a table in the repository, replacing an older one, and write its page."""
    from tactile_lab.cli.console import say
    from tactile_lab.evaluation.sweep import summary_cells, summary_titles
    from tactile_lab.experiments.reporting import made_here
    from tactile_lab.experiments.results.publishing import publish
    from tactile_lab.experiments.results.stored_result import Part, Table
    from tactile_lab.experiments.results.storing import store

    table = Table("", tuple(summary_titles()), tuple(tuple(summary_cells(summary)) for summary in found), keys=2)
    about = "Policy information, fingertips that feel forces, truth from the rendered marker camera."
    say(f"stored  {store(docs, name, sentence, Part(made_here(), (command,), about, (table,)))}")
    for page in publish(docs):
        say(f"page  {page}")


def _numbers(text: str, option: str, smallest: int = 0, largest: int | None = None) -> tuple[int, ...]:
    """Whole numbers from a comma-separated list. Raises BadParameter."""
    wanted = f"from {smallest} to {largest}" if largest is not None else f"of at least {smallest}"
    try:
        numbers = tuple(int(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if not numbers or any(number < smallest or (largest is not None and number > largest) for number in numbers):
        problem = f"{text!r} is not a comma-separated list of whole numbers {wanted}"
        raise typer.BadParameter(problem, param_hint=f"'{option}'")
    return numbers
