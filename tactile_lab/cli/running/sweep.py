"""``tactile-lab sweep``: many simulated sessions in one table."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Annotated

import typer

from tactile_lab.cli.options import METHOD_HELP, Json, Method, NoInput, RigName


def sweep(
    objects: Annotated[str, typer.Option(help="Comma-separated object names, or 'all'.")] = "all",
    seeds: Annotated[str, typer.Option(help="Comma-separated random seeds.")] = "1,2,3",
    dimensions: Annotated[str, typer.Option(help="Comma-separated dimensions: 2, 3 or 2,3.")] = "2,3",
    method: Annotated[Method, typer.Option(help=METHOD_HELP)] = Method.JOINT,
    grasps: Annotated[int, typer.Option(min=1, help="Number of grasps per session.")] = 16,
    rig: RigName = "sim",
    jobs: Annotated[int, typer.Option(min=1, help="Number of parallel sessions.")] = 2,
    out: Annotated[Path, typer.Option(help="Folder for the sessions and table.md.")] = Path("runs/sweep"),
    check_replay: Annotated[
        bool,
        typer.Option("--check-replay", help="Replay every session; a session whose replay differs counts as failed."),
    ] = False,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Run a simulated session for every object, seed and dimension, and tabulate errors and failures."""
    from concurrent.futures import ProcessPoolExecutor
    from functools import partial

    from drivers.core.atomic_files import write_whole
    from tactile_lab.cli.console import emit_json, say, show_table
    from tactile_lab.evaluation.sweep import (
        markdown_table,
        planned_runs,
        summaries,
        summary_cells,
        summary_titles,
        sweep,
    )
    from tactile_lab.workflow.sweeping import check_sweep, run_for_sweep

    del no_input
    names = None if objects == "all" else tuple(name.strip() for name in objects.split(","))
    chosen = _numbers(dimensions, "--dimensions", smallest=2, largest=3)
    drawn = _numbers(seeds, "--seeds")
    runs = planned_runs(check_sweep(rig, names, out, method), chosen, drawn)
    job = partial(run_for_sweep, rig=rig, method=str(method), grasps=grasps, root=out, check_replay=check_replay)
    with ProcessPoolExecutor(jobs, initializer=_leave_ctrl_c_to_the_parent) as pool:
        rows = sweep(runs, job, lambda row: say(row.line()), pool.map)
    found = summaries(rows)
    if as_json:
        emit_json([row.as_json() for row in rows])
    else:
        show_table("Median / 90th percentile / maximum", summary_titles(), map(summary_cells, found))
    write_whole(out / "table.md", markdown_table(found))
    say(f"table  {out / 'table.md'}")
    if all(row.evaluation is None for row in rows):
        raise typer.Exit(1)


def _leave_ctrl_c_to_the_parent() -> None:
    """Ctrl+C reaches every process of the terminal: outside a session only the parent process handles it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


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
