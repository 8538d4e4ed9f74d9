"""Runs the cells of an experiment in worker processes and stores every result as soon as it is finished.

The file starts with a line that names the experiment and the version of the program; one line of JSON for each finished
run follows. An interrupted experiment resumes where it stopped; results of another version are mixed in only on
request. A run that ends in an error becomes a failed run with its reason. Results depend only on the cells, not on the
number of processes; times do.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from multiprocessing.process import BaseProcess
from multiprocessing.queues import SimpleQueue
from pathlib import Path
from typing import IO

from drivers.core.atomic_files import write_whole
from drivers.core.errors import SessionError, TactileLabError
from drivers.core.extensions import load_named_extensions
from tactile_lab.experiments.cells import Cell, Row, Work

FORMAT = "tactile-experiment/1"
SEVERAL = "several versions"
"""Version in a file with results of several versions, so that no version takes them for its own."""
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
"""Limits the libraries of a worker to one thread: small matrices are faster this way, and sums are reproducible."""

_LOOK_s = 0.5
"""Longest wait: a Ctrl+C just before a wait would otherwise be noticed only when the next run is finished."""
_ASKED = 25
"""Number and total time of attempts to read the exit code of a process that has died."""
_ROOT = Path(__file__).resolve().parents[2]
_PLOTS = ("plots", "plot_data", "plot_sheet")
_PARTS = ("tactile_lab", "calibration", "drivers", "sessions")
_WITHOUT = ("cli", "workflow", "view", "report", "experiments/results", *(f"experiments/{name}.py" for name in _PLOTS))
"""Parts of tactile_lab that only present results or read commands, except for these modules:"""
_WITH = tuple(f"workflow/{name}.py" for name in ("attending", "calibrating_forearm", "finishing", "running"))

Finished = Callable[[Row, int, int], None]
"""Called with each finished run, the number of finished runs, and the total."""


@dataclass(frozen=True)
class RunnerSettings:
    """Settings for running an experiment.

    Attributes:
        jobs: number of processes; with 1 all runs are made in this process.
        keep: whether to keep the results of another version of the program.
    """

    jobs: int = 1
    keep: bool = False


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
        settings: number of processes, and which results to keep.
        finished: called after each run.

    Raises:
        SessionError: the file belongs to another experiment, cannot be read, or a process died.
        WriteError: the file cannot be written.
    """
    settings = settings or RunnerSettings()
    known, by = _known_rows(name, file, settings.keep)
    missing = [cell for cell in cells if cell.key not in known]
    done = len(cells) - len(missing)
    with _appending(name, file, by, list(known.values())) as out:
        for row in _execute(missing, work, settings.jobs):
            known[row.cell.key] = row
            out.write(_line(row.as_json()))
            out.flush()
            done += 1
            finished(row, done, len(cells))
    return [known[cell.key] for cell in cells]


def execute(cell: Cell, work: Work) -> Row:
    """Run one cell; any error becomes the result of this run, and the others continue."""
    try:
        return Row(cell, work(cell))
    except TactileLabError as error:
        return Row(cell, None, str(error))
    except Exception as error:  # a defect appears in the table as a failed run with its name
        return Row(cell, None, f"{type(error).__name__}: {error}")


def _execute(cells: Sequence[Cell], work: Work, jobs: int) -> Iterator[Row]:
    if jobs == 1 or len(cells) < 2:
        return map(partial(execute, work=work), cells)
    return _in_processes(cells, work, jobs)


@contextmanager
def _inherited() -> Iterator[None]:
    """Set the environment of workers: one thread each, and no imports from the current folder."""
    wanted = {**ONE_THREAD, "PYTHONSAFEPATH": "1"}
    own = {name: os.environ.get(name) for name in wanted}
    os.environ.update(wanted)
    try:
        yield
    finally:
        for name, value in own.items():
            os.environ.pop(name)
            if value is not None:
                os.environ[name] = value


def _in_processes(cells: Sequence[Cell], work: Work, jobs: int) -> Iterator[Row]:
    """Yields rows as they are finished; the processes end with this generator, however it ends."""
    context = multiprocessing.get_context("spawn")
    watch = _WorkerWatch(context.SimpleQueue(), cells)
    pool = ProcessPoolExecutor(jobs, mp_context=context, initializer=_prepare_worker, initargs=(watch.begun,))
    try:
        with _inherited():
            waiting = {pool.submit(_execute_in_worker, cell, work) for cell in cells}
        while waiting:
            watch.look(pool)
            ready, waiting = wait(waiting, _LOOK_s, return_when=FIRST_COMPLETED)
            for future in ready:
                yield future.result()
    except BrokenProcessPool as error:
        hint = "Memory may have run out: use fewer --jobs. Finished runs are kept: the same command resumes behind them"
        raise SessionError(watch.deaths(), where="workers", hint=hint) from error
    finally:
        _end(pool)


def _end(pool: ProcessPoolExecutor) -> None:
    """End the workers at once: a run may take a minute, and its result is no longer needed."""
    for process in multiprocessing.active_children():
        process.terminate()
    pool.shutdown(wait=True, cancel_futures=True)


class _WorkerWatch:
    """Tracks the current run of each worker, so that the report of a dead worker can name it.

    Args:
        begun: queue to which workers write their process id and the key of the run that they start.
        cells: all runs.
    """

    def __init__(self, begun: SimpleQueue[tuple[int, str]], cells: Sequence[Cell]) -> None:
        self.begun = begun
        self._cells = {cell.key: cell for cell in cells}
        self._at: dict[int, str] = {}
        self._processes: dict[int, BaseProcess] = {}

    def look(self, pool: ProcessPoolExecutor) -> None:
        """Update the list of workers and of the runs that they have started."""
        self._processes.update(pool._processes or {})
        self._hear()

    def _hear(self) -> None:
        while not self.begun.empty():
            process_id, key = self.begun.get()
            self._at[process_id] = key

    def deaths(self) -> str:
        """Describe which workers died, why, and in which run; the pool ends the others by SIGTERM."""
        self._hear()
        codes = {number: _exit_code(process) for number, process in self._processes.items()}
        ended = {number: code for number, code in codes.items() if code}
        own = {number: code for number, code in ended.items() if code != -signal.SIGTERM} or ended
        told = [f"{_cause(code)} at {self._words(number)}" for number, code in own.items()]
        return f"a worker process was {'; '.join(told)}" if told else "a worker process died"

    def _words(self, process_id: int) -> str:
        key = self._at.get(process_id)
        return "its start" if key is None else self._cells[key].words()


def _exit_code(process: BaseProcess) -> int | None:
    """The exit code of a process. It may come late: the pipe closes earlier, and the pool's own thread may be reading
    it.
    """
    for _ in range(_ASKED):
        if process.exitcode is not None:
            break
        time.sleep(_LOOK_s / _ASKED)
    return process.exitcode


def _cause(code: int) -> str:
    if code > 0:
        return f"ended with exit code {code}"
    return f"killed by {signal.Signals(-code).name}"


_begun: SimpleQueue[tuple[int, str]] | None = None
"""In a worker: the queue to which it reports each run that it starts."""


def _execute_in_worker(cell: Cell, work: Work) -> Row:
    if _begun is not None:
        _begun.put((os.getpid(), cell.key))
    return execute(cell, work)


def _prepare_worker(begun: SimpleQueue[tuple[int, str]]) -> None:
    """Ignore Ctrl+C, which reaches every process of a terminal but is handled by the parent; load extensions."""
    global _begun
    _begun = begun
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    load_named_extensions()


def kept_rows(name: str, file: Path) -> list[Row]:
    """All results in the file that this version of the program made. Raises SessionError as :func:`run_cells`."""
    return list(_known_rows(name, file, keep=False)[0].values())


def _known_rows(name: str, file: Path, keep: bool) -> tuple[dict[str, Row], str]:
    """Results in the file by the key of their cell, and the version that made them."""
    if not file.is_file():
        return {}, version()
    try:
        head, *lines = file.read_text(encoding="utf-8").splitlines()
        found = json.loads(head)
        if found["format"] != FORMAT or found["experiment"] != name:
            raise SessionError(
                f"contains results of {found['experiment']}", where=str(file), hint="Choose another --out"
            )
        rows = [Row.from_json(json.loads(line)) for line in _whole(lines)]
    except (OSError, ValueError, KeyError, TypeError) as error:
        hint = "Remove the file to start again, or choose another --out"
        raise SessionError("is not a results file", where=str(file), hint=hint) from error
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


@cache
def version() -> str:
    """Hash of the sources that results depend on."""
    digest = hashlib.sha256()
    for path in sources():
        digest.update(path.relative_to(_ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def sources() -> list[Path]:
    """Files that results depend on: programs, and the rigs' descriptions and calibrations."""
    files = (path for part in _PARTS for path in (_ROOT / part).rglob("*") if path.suffix in {".py", ".yaml"})
    left_out, taken = ([_ROOT / "tactile_lab" / name for name in names] for names in (_WITHOUT, _WITH))
    return sorted(path for path in files if path in taken or not any(map(path.is_relative_to, left_out)))
