"""``tactile-lab experiment``: the figures of the thesis and the tables of methods, from simulated contacts."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_lab.cli.options import Json, NoInput

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tactile_lab.experiments.cells import Row


def experiment(
    name: Annotated[str, typer.Argument(help="Name of the experiment; 'list' shows them all.")],
    seeds: Annotated[str, typer.Option(help="Seeds, for example 0-2,7. Those from 1000 on are for reports.")] = (
        "1000-1029"
    ),
    jobs: Annotated[int, typer.Option(min=0, help="Runs side by side; 0 takes all cores.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder of the results (runs/experiments/NAME).")] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(help="Limit a setting: method=joint,icp (; where values have commas)."),
    ] = None,
    grasps: Annotated[int | None, typer.Option(min=1, help="Other number of grasps, for a quick look.")] = None,
    keep: Annotated[bool, typer.Option("--keep", help="Keep the results of another version of the program.")] = False,
    into: Annotated[Path | None, typer.Option(help="Markdown document whose section to replace.")] = None,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Run an experiment over its seeds; one that was broken off goes on where it stopped."""
    del no_input
    if name == "list":
        _list(as_json)
        return
    from tactile_lab.cli.console import emit_json, say, show_table, warn
    from tactile_lab.cli.experiment_progress import ExperimentProgress
    from tactile_lab.experiments.catalogue import experiment
    from tactile_lab.experiments.reporting import LINES_FILE, document, insert_section, write_report
    from tactile_lab.experiments.runner import RunnerSettings, run_cells
    from tactile_lab.experiments.summary import grouped, short_table

    study, processes = experiment(name), jobs or os.cpu_count() or 1
    folder = out or Path("runs/experiments") / name
    cells = study.cells(_seeds(seeds), _limits(only or []), grasps)
    if study.left_out():
        warn(study.left_out())
    with ExperimentProgress(study.name, len(cells)) as progress:
        settings = RunnerSettings(processes, keep)
        rows = run_cells(name, cells, study.work, folder / LINES_FILE, settings, progress.finished)
    write_report(study, rows, folder, processes)
    if into is not None:
        insert_section(into, study, rows, processes)
    if as_json:
        emit_json(document(study, rows, processes))
    else:
        head, *body = short_table(grouped(rows, over=study.pooled), study.columns)
        show_table(study.sentence, head, body)
    say(f"results  {folder}")
    _end(rows)


def _list(as_json: bool) -> None:
    from tactile_lab.cli.console import emit_json, show_table
    from tactile_lab.experiments.catalogue import EXPERIMENTS

    found = [(study.name, study.sentence, len(study.cells())) for study in EXPERIMENTS.values()]
    if as_json:
        emit_json([{"name": name, "sentence": sentence, "runs": runs} for name, sentence, runs in found])
        return
    show_table(
        "Experiments", ["name", "runs", "what it shows"], [(name, str(runs), text) for name, text, runs in found]
    )


def _end(rows: Sequence[Row]) -> None:
    if all(row.figures is None for row in rows):
        from tactile_lab.cli.console import complain

        complain(f"every run failed; the first: {rows[0].problem}")
        raise typer.Exit(1)


def _seeds(text: str) -> list[int]:
    """Numbers and ranges, separated by commas. Raises BadParameter."""
    seeds: list[int] = []
    for part in text.split(","):
        low, _, high = part.strip().partition("-")
        if not low.isdigit() or (high and not high.isdigit()) or part.strip().endswith("-"):
            problem = f"{text!r} is not a list of seeds like 0-2,7"
            raise typer.BadParameter(problem, param_hint="'--seeds'")
        seeds += range(int(low), int(high or low) + 1)
    if not seeds:
        raise typer.BadParameter(f"{text!r} has no seed in it", param_hint="'--seeds'")
    return list(dict.fromkeys(seeds))


def _limits(only: list[str]) -> dict[str, list[str]]:
    """Values by the name of their setting. Raises BadParameter."""
    limits = {}
    for text in only:
        name, equals, values = text.partition("=")
        if not (name and equals and values):
            raise typer.BadParameter(f"{text!r} is not of the form setting=value,value", param_hint="'--only'")
        parts = values.split(";" if ";" in values else ",")
        limits[name] = [value.strip() for value in parts if value.strip()]
    return limits
