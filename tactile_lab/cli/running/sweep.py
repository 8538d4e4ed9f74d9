"""``tactile-lab sweep``: many simulated sessions in one table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

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
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Run a simulated session for every object, seed and dimension, and tabulate errors and failures.

    A sweep that was interrupted, or whose worker was killed, goes on behind its finished runs when it is started again.
    """
    from functools import partial

    from drivers.core.atomic_files import write_whole
    from tactile_lab.cli.console import answer, emit_json, say, show_table
    from tactile_lab.cli.running.sweep_cells import cell_of, row_of, run_sweep_cell
    from tactile_lab.evaluation.sweep import markdown_table, planned_runs, summaries, summary_cells, summary_titles
    from tactile_lab.experiments.parquet import write_parquet
    from tactile_lab.experiments.runner import LINES_FILE, RunnerSettings, run_cells
    from tactile_lab.workflow.sweeping import check_sweep

    del no_input
    names = None if objects == "all" else tuple(name.strip() for name in objects.split(","))
    chosen = _numbers(dimensions, "--dimensions", smallest=2, largest=3)
    drawn = _numbers(seeds, "--seeds", largest=LARGEST_SEED)
    runs = planned_runs(check_sweep(rig, names, out, method), chosen, drawn)
    cells = [cell_of(run, rig, method, grasps, check_replay) for run in runs]
    folder = out.resolve()  # for workers, which stand elsewhere
    others = tuple(each / LINES_FILE for each in merge or ())
    settings = RunnerSettings(jobs, scheduler=scheduler, shared=folder, others=others)
    work = partial(run_sweep_cell, root=folder if scheduler else out)
    done = run_cells("sweep", cells, work, out / LINES_FILE, settings, lambda row, *_: say(row_of(row).line()))
    if parquet is not None:
        write_parquet(parquet, "sweep", done)
    rows = [row_of(row) for row in done]
    found = summaries(rows)
    if as_json:
        emit_json([row.as_json() for row in rows])
    else:
        show_table("Median / 90th percentile / maximum", summary_titles(), map(summary_cells, found))
    write_whole(out / "table.md", markdown_table(found))
    answer(f"table  {out / 'table.md'}")
    if any(row.evaluation is None for row in rows):
        raise typer.Exit(1 if all(row.evaluation is None for row in rows) else 3)


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
