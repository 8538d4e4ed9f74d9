"""Runs the cells of an experiment and stores every result as soon as it is finished.

The file starts with a line that names the experiment and the version of the program; one line of JSON for each finished
run follows. An interrupted experiment resumes where it stopped; results of another version are mixed in only on
request. A run that ends in an error becomes a failed run with its reason. Results depend only on the cells, not on the
number of processes or machines; times do.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO

from drivers.core.atomic_files import write_whole
from drivers.core.errors import ConfigurationError
from drivers.core.reading.bounded_files import MB, read_bounded
from drivers.core.reading.json_text import parse_json
from tactile_lab.experiments.cells import Cell, Execute, Row, Work, execute
from tactile_lab.experiments.execution.cluster import cluster_at
from tactile_lab.experiments.execution.process_pool import run_in_processes
from tactile_lab.experiments.execution.source_version import version

FORMAT = "tactile-experiment/1"
LINES_FILE = "runs.jsonl"
_LARGEST_bytes = 200 * MB
"""A hundred thousand runs."""
SEVERAL = "several versions"
"""Version in a file with results of several versions, so that no version takes them for its own."""

Finished = Callable[[Row, int, int], None]
"""Called with each finished run, the number of finished runs, and the total."""


@dataclass(frozen=True)
class RunnerSettings:
    """Settings for running an experiment.

    Attributes:
        jobs: number of processes; with 1 all runs are made in this process.
        keep: whether to keep the results of another version of the program.
        scheduler: address of a Dask scheduler whose workers make the runs instead; "" for none.
        shared: a folder that all workers of a cluster have to see, as the runs write into it.
        others: files of results from other machines, whose finished runs count as made.
    """

    jobs: int = 1
    keep: bool = False
    scheduler: str = ""
    shared: Path | None = None
    others: tuple[Path, ...] = ()


def run_cells(
    name: str,
    cells: Sequence[Cell],
    work: Work,
    file: Path,
    settings: RunnerSettings | None = None,
    finished: Finished = lambda row, done, total: None,
) -> list[Row]:
    """Run the cells that are not yet in the file; returns one row per cell, in the order of the cells.

    Args:
        name: name of the experiment.
        cells: the runs to make.
        work: runs one cell; must be picklable if there is more than one process.
        file: file of results, created if missing.
        settings: where to run, and which results to keep.
        finished: called after each run.

    Raises:
        ConfigurationError: the file belongs to another experiment, or cannot be read.
        SessionError: a process died.
        ConfigurationError: the cluster cannot be used.
        WriteError: the file cannot be written.
    """
    settings = settings or RunnerSettings()
    known, by = _known_rows(name, file, settings.keep)
    for other in settings.others:
        known = {**_rows_of_another_machine(name, other), **known}
    missing = [cell for cell in cells if cell.key not in known]
    done = len(cells) - len(missing)
    place = _place(settings) if missing else nullcontext(_execute_here)
    with place as execute_all, _appending(name, file, by, list(known.values())) as out:
        for row in execute_all(missing, work):
            known[row.cell.key] = row
            out.write(_line(row.as_json()))
            out.flush()
            done += 1
            finished(row, done, len(cells))
    return [known[cell.key] for cell in cells]


def _place(settings: RunnerSettings) -> AbstractContextManager[Execute]:
    """Where runs are made; entered before the file is opened: a cluster that is not there costs no earlier result."""
    if settings.scheduler:
        return cluster_at(settings.scheduler, settings.shared)
    return nullcontext(partial(_execute_here, jobs=settings.jobs))


def _execute_here(cells: Sequence[Cell], work: Work, jobs: int = 1) -> Iterator[Row]:
    if jobs == 1 or len(cells) < 2:
        return map(partial(execute, work=work), cells)
    return run_in_processes(cells, work, jobs)


def check_results(name: str, file: Path, others: Sequence[Path] = ()) -> None:
    """Refuse files of results that :func:`run_cells` would refuse. Raises ConfigurationError as it does."""
    _known_rows(name, file, keep=True)
    for other in others:
        _rows_of_another_machine(name, other)


def kept_rows(name: str, file: Path) -> list[Row]:
    """All results in the file that this version of the program made. Raises ConfigurationError as :func:`run_cells`."""
    return list(_known_rows(name, file, keep=False)[0].values())


def _rows_of_another_machine(name: str, file: Path) -> dict[str, Row]:
    if not file.is_file():
        raise ConfigurationError("no results here", where=str(file), hint=f"Give the folder that contains {LINES_FILE}")
    rows, by = _known_rows(name, file, keep=True)
    if by == SEVERAL:
        hint = "Merge results of one version only: the same commit on every machine"
        raise ConfigurationError("was made by another version of the program", where=str(file), hint=hint)
    return rows


def _known_rows(name: str, file: Path, keep: bool) -> tuple[dict[str, Row], str]:
    """Results in the file by the key of their cell, and the version that made them."""
    if not file.is_file():
        return {}, version()
    try:
        head, *lines = read_bounded(file, _LARGEST_bytes).decode("utf-8").splitlines()
        found = parse_json(head.encode())
        if found["format"] != FORMAT or found["experiment"] != name:
            raise ConfigurationError(
                f"contains results of {found['experiment']}", where=str(file), hint="Choose another --out"
            )
        rows = [Row.from_json(parse_json(line.encode())) for line in _whole(lines)]
    except (OSError, ValueError, KeyError, TypeError) as error:
        hint = "Remove the file to start again, or choose another --out"
        raise ConfigurationError("is not a results file", where=str(file), hint=hint) from error
    same = found["version"] == version()
    if not (same or keep):
        return {}, version()
    return {row.cell.key: row for row in rows}, version() if same else SEVERAL


def _whole(lines: list[str]) -> list[str]:
    """The text without an incomplete last line, left when the program was killed."""
    return lines[:-1] if lines and not lines[-1].endswith("}") else lines


def _appending(name: str, file: Path, by: str, rows: list[Row]) -> IO[str]:
    """Open the file for appending, after its header and the rows to keep."""
    head = {"format": FORMAT, "experiment": name, "version": by}
    lines = "".join(map(_line, [head, *(row.as_json() for row in rows)]))
    write_whole(file, lines, "Choose another folder with --out")
    return file.open("a", encoding="utf-8")


def _line(document: object) -> str:
    return json.dumps(document, allow_nan=False) + "\n"
