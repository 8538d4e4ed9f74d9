"""Runs cells in processes of this machine."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.process import BaseProcess
from multiprocessing.queues import SimpleQueue

from drivers.core.errors import SessionError
from drivers.core.extensions import load_named_extensions
from tactile_lab.experiments.cells import Cell, Row, Work, execute

ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
"""Limits the libraries of a worker to one thread: small matrices are faster this way, and sums are reproducible."""


_LOOK_s = 0.5
"""Longest wait: a Ctrl+C just before a wait would otherwise be noticed only when the next run is finished."""
_ASKED = 25
"""Number and total time of attempts to read the exit code of a process that has died."""


def run_in_processes(cells: Sequence[Cell], work: Work, jobs: int) -> Iterator[Row]:
    """Yields rows as they are finished; the processes end with this generator, however it ends.

    Raises:
        SessionError: a process died.
    """
    context = multiprocessing.get_context("spawn")
    with _inherited():  # the first queue already starts a process, which keeps account of semaphores
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
