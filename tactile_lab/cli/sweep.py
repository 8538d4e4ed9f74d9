"""``tactile-lab sweep``: many sessions, one table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def sweep(
    objects: Annotated[str, typer.Option(help="Comma-separated object names, or 'all'.")] = "all",
    seeds: Annotated[str, typer.Option(help="Comma-separated seeds.")] = "1,2,3",
    dimensions: Annotated[str, typer.Option(help="2, 3 or 2,3.")] = "2,3",
    method: Annotated[str, typer.Option(help="particle or thesis.")] = "particle",
    grasps: Annotated[int, typer.Option(min=1, help="Grasps a session.")] = 16,
    rig: Annotated[str, typer.Option(help="Name of a simulated rig, or a rig file.")] = "sim",
    jobs: Annotated[int, typer.Option(min=1, help="Sessions side by side.")] = 2,
    out: Annotated[Path, typer.Option(help="Folder of the sessions and of table.md.")] = Path("runs/sweep"),
    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on standard output.")] = False,
) -> None:
    """Run a session for every object, seed and dimension, and tabulate errors with spread and failures."""
    from concurrent.futures import ProcessPoolExecutor
    from functools import partial

    from sessions.manifest import write_whole
    from tactile_lab.cli.console import emit_json, people, say, table
    from tactile_lab.evaluation.sweep import (
        markdown_table,
        planned_runs,
        summaries,
        summary_cells,
        summary_titles,
        sweep,
    )
    from tactile_lab.workflow import catalogue, run_for_sweep, slam_settings

    names = catalogue() if objects == "all" else tuple(objects.split(","))
    runs = planned_runs(names, _numbers(dimensions, "--dimensions"), _numbers(seeds, "--seeds"))
    slam_settings(method, 2)  # a wrong method ends here, not in every run
    job = partial(run_for_sweep, rig=rig, method=method, grasps=grasps, root=out)
    with ProcessPoolExecutor(jobs) as pool:
        rows = sweep(runs, job, lambda row: say(row.line()), pool.map)
    found = summaries(rows)
    if as_json:
        emit_json([row.as_json() for row in rows])
    else:
        people.print(table("median / p90 / maximum", summary_titles(), map(summary_cells, found)))
    write_whole(out / "table.md", markdown_table(found).encode())
    say(f"table  {out / 'table.md'}")


def _numbers(text: str, option: str) -> tuple[int, ...]:
    try:
        return tuple(int(part) for part in text.split(","))
    except ValueError as error:
        raise typer.BadParameter(
            f"{text!r} is not a comma-separated list of whole numbers", param_hint=option
        ) from error
