"""``tactile-lab experiment``: the thesis's figures and tables of methods, from simulated contacts."""

from __future__ import annotations

import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_lab.cli.completion import complete_experiment
from tactile_lab.cli.options import (
    LARGEST_SEED,
    MOST_GRASPS,
    MOST_JOBS,
    Json,
    Merge,
    NoInput,
    ParquetFile,
    Scheduler,
    writable_folder,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from tactile_lab.experiments.cells import Row
    from tactile_lab.experiments.experiment import Experiment
    from tactile_lab.experiments.results.publishing import Age
    from tactile_lab.experiments.results.stored_result import Part


def experiment(
    name: Annotated[
        str,
        typer.Argument(
            help="Name of the experiment. 'list' lists all experiments, 'pages' writes the pages of stored results, "
            "'age' says which of them are older than the code, 'commands' prints the commands that made them.",
            autocompletion=complete_experiment,
        ),
    ],
    seeds: Annotated[
        str, typer.Option(help="Random seeds, for example 0-2,7. Seeds from 1000 on are reserved for reported results.")
    ] = ("1000-1029"),
    jobs: Annotated[int, typer.Option(min=0, max=MOST_JOBS, help="Number of parallel runs; 0 uses all cores.")] = 0,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for the results (default: runs/experiments/NAME).", callback=writable_folder),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(
            help="Restrict a setting: method=joint,icp (separate values that contain commas by ;). Can be repeated."
        ),
    ] = None,
    grasps: Annotated[
        int | None, typer.Option(min=1, max=MOST_GRASPS, help="Use another number of grasps, for a quick check.")
    ] = None,
    keep: Annotated[
        bool, typer.Option("--keep", help="Keep finished runs that were made by another version of the program.")
    ] = False,
    store: Annotated[
        bool, typer.Option("--store", help="Store the result in the repository and write its pages.")
    ] = False,
    forget: Annotated[bool, typer.Option("--forget", help="With --store: discard results of older versions.")] = False,
    scheduler: Scheduler = "",
    merge: Merge = None,
    parquet: ParquetFile = None,
    docs: Annotated[Path, typer.Option(help="Documentation folder with the stored results and pages.")] = Path("docs"),
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Run an experiment over its seeds. An interrupted experiment resumes where it stopped."""
    del no_input
    if name in _WORDS:
        _WORDS[name](docs, as_json)
        return
    if store and keep:
        raise typer.BadParameter(
            "a result made by several versions cannot be stored: leave out --keep", param_hint="'--store'"
        )
    from tactile_lab.experiments.runner import LINES_FILE, RunnerSettings, check_results, kept_rows, run_cells

    folder = out or Path("runs/experiments") / name
    others = tuple(each / LINES_FILE for each in merge or ())
    check_results(name, folder / LINES_FILE, others)  # before the studies are loaded, which takes seconds
    from tactile_lab.cli.console import answer, emit_json, show_table, warn
    from tactile_lab.cli.experiment_progress import ExperimentProgress
    from tactile_lab.experiments.catalogue import experiment
    from tactile_lab.experiments.groups import group_runs
    from tactile_lab.experiments.parquet import write_parquet
    from tactile_lab.experiments.reporting import document, part_of, write_report
    from tactile_lab.experiments.summary import short_table

    study, processes = experiment(name), jobs or os.cpu_count() or 1
    cells = study.cells(_seeds(seeds), _limits(only or []), grasps)
    if study.left_out():
        warn(study.left_out())
    with ExperimentProgress(study.name, len(cells)) as progress:
        settings = RunnerSettings(processes, keep, scheduler, others=others)
        rows = run_cells(name, cells, study.work, folder / LINES_FILE, settings, progress.on_finished)
    command = _command(name, seeds, only or [], grasps, jobs)
    write_report(study, rows, folder, processes, command)
    if store:
        made = _of_study(study, kept_rows(name, folder / LINES_FILE), grasps)
        _store(docs, study, part_of(study, made, processes, command, grasps), forget)
    if as_json:
        emit_json(document(study, rows, processes))
    else:
        head, *body = short_table(group_runs(rows, over=study.pooled), study.columns)
        show_table(study.sentence, head, body)
    answer(f"results  {folder}")
    if parquet is not None:
        write_parquet(parquet, name, rows)
    _end(rows)


_MOST_SEEDS = 100_000


def _command(name: str, seeds: str, only: Sequence[str], grasps: int | None, jobs: int) -> str:
    """The command that repeats this run."""
    words = ["tactile-lab", "experiment", name, "--seeds", seeds]
    words += [word for text in only for word in ("--only", text)]
    words += [] if grasps is None else ["--grasps", str(grasps)]
    return shlex.join([*words, "--jobs", str(jobs)] if jobs else words)


def _of_study(study: Experiment, rows: Sequence[Row], grasps: int | None) -> list[Row]:
    """The runs with this number of grasps, ordered by settings: parts may have been run separately."""
    seeds = sorted({row.cell.seed for row in rows})
    places = {cell.key: place for place, cell in enumerate(study.cells(seeds, None, grasps))}
    return sorted((row for row in rows if row.cell.key in places), key=lambda row: places[row.cell.key])


def _store(docs: Path, study: Experiment, part: Part, forget: bool) -> None:
    from tactile_lab.cli.console import say, warn
    from tactile_lab.experiments.results.storing import partial_rows, store

    partial = [] if forget else partial_rows(docs, study.name, part)
    say(f"stored  {store(docs, study.name, study.sentence, part, forget=forget)}")
    if partial:
        warn(
            f"the older row stays for {'; '.join(partial)}: it is of more {' and '.join(study.pooled)}s together than "
            "these runs. Add the runs of the others with --merge FOLDER, or drop what is older with --forget"
        )
    _write_pages(docs)


def _write_pages(docs: Path, as_json: bool = False) -> None:
    from tactile_lab.cli.console import say
    from tactile_lab.experiments.results.publishing import publish

    del as_json
    changed = publish(docs)
    for path in changed:
        say(f"page  {path}")
    say(f"{len(changed)} pages and pictures changed")
    say(_age_in_words(_ages(docs)))


def _show_age(docs: Path, as_json: bool) -> None:
    from tactile_lab.cli.console import emit_json, say, show_table

    ages = _ages(docs)
    if as_json:
        emit_json([vars(age) for age in ages])
        return
    rows = [(age.name, age.date, age.version, "this version" if age.is_current else "older") for age in ages]
    show_table("Stored results", ["name", "made on", "made by", "the code"], rows)
    say(_age_in_words(ages))


def _ages(docs: Path) -> list[Age]:
    from tactile_lab.experiments.execution.source_version import version
    from tactile_lab.experiments.results.publishing import ages

    return ages(docs, version())


def _age_in_words(ages: Sequence[Age]) -> str:
    older = sum(not age.is_current for age in ages)
    return f"{older} of {len(ages)} stored tables were made by an older version of the code"


def _show_commands(docs: Path, as_json: bool) -> None:
    from tactile_lab.cli.console import answer, emit_json
    from tactile_lab.experiments.results.publishing import stored_results

    made = [command for result in stored_results(docs).values() for part in result.parts for command in part.commands]
    commands = [command for command in dict.fromkeys(made) if command.startswith("tactile-lab experiment ")]
    if as_json:
        emit_json(commands)
        return
    for command in commands:
        answer(command)


def _list(docs: Path, as_json: bool) -> None:
    from tactile_lab.cli.console import emit_json, show_table
    from tactile_lab.experiments.catalogue import EXPERIMENTS

    del docs
    found = [(study.name, study.sentence, len(study.cells())) for study in EXPERIMENTS.values()]
    if as_json:
        emit_json([{"name": name, "sentence": sentence, "runs": runs} for name, sentence, runs in found])
        return
    show_table(
        "Experiments", ["name", "runs", "what it shows"], [(name, str(runs), text) for name, text, runs in found]
    )


_WORDS: Mapping[str, Callable[[Path, bool], None]] = {
    "list": _list,
    "pages": _write_pages,
    "age": _show_age,
    "commands": _show_commands,
}
"""Keywords accepted in place of a name, and what they do."""


def _end(rows: Sequence[Row]) -> None:
    if all(row.figures is None for row in rows):
        from tactile_lab.cli.console import complain

        complain(f"every run failed; first error: {rows[0].problem}")
        raise typer.Exit(1)
    if any(row.figures is None for row in rows):
        raise typer.Exit(3)


def _seeds(text: str) -> list[int]:
    """Numbers and ranges, separated by commas. Raises BadParameter."""
    seeds: list[int] = []
    for part in text.split(","):
        low, _, high = part.strip().partition("-")
        if not low.isdigit() or (high and not high.isdigit()) or part.strip().endswith("-"):
            problem = f"{text!r} is not a list of seeds such as 0-2,7"
            raise typer.BadParameter(problem, param_hint="'--seeds'")
        first, last = int(low), int(high or low)
        if last > LARGEST_SEED or last - first >= _MOST_SEEDS:
            problem = f"seeds go up to {LARGEST_SEED}, and {_MOST_SEEDS} of them at a time"
            raise typer.BadParameter(problem, param_hint="'--seeds'")
        seeds += range(first, last + 1)
    if not seeds:
        raise typer.BadParameter(f"{text!r} contains no seed", param_hint="'--seeds'")
    return list(dict.fromkeys(seeds))


def _limits(only: list[str]) -> dict[str, list[str]]:
    """Values by setting. Raises BadParameter."""
    limits = {}
    for text in only:
        name, equals, values = text.partition("=")
        if not (name and equals and values):
            raise typer.BadParameter(f"{text!r} is not of the form setting=value,value", param_hint="'--only'")
        parts = values.split(";" if ";" in values else ",")
        limits[name] = [value.strip() for value in parts if value.strip()]
    return limits
