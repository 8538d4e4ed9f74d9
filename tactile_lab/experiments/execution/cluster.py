"""Runs cells on a Dask cluster: workers of one thread each, on as many machines as there are.

A worker that dies costs nothing but time: the scheduler gives its run to another. A run that takes several workers with
it is named at the end, when all others are made. Results come back as they are finished, and only a few runs are handed
over at a time, so neither the scheduler nor this process grows with their number.

Connections are encrypted where the address begins with ``tls://``; Dask's own configuration names the certificates.
"""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from drivers.core.errors import ConfigurationError, SessionError
from drivers.core.extensions import VARIABLE, load_named_extensions
from tactile_lab.experiments.cells import Cell, Execute, Row, Work, execute
from tactile_lab.experiments.execution.source_version import version

if TYPE_CHECKING:
    from distributed import Client, Future

_AHEAD = 3
"""Runs handed over for each worker: one that it makes, and some to go on with."""

_CONNECT_s, _LOOK_s, _PATIENCE_s = 5.0, 0.5, 120.0
"""Time for the scheduler, and for a first worker; longest wait without a look at Ctrl+C; time without any worker."""

_RESUMES = "Finished runs are kept: the same command resumes behind them"


@contextmanager
def cluster_at(address: str, shared: Path | None = None) -> Iterator[Execute]:
    """Connect to a cluster; gives what makes runs on it, and yields their rows as they are finished.

    What runs a cell has to be a function that the workers can import. Making the rows raises SessionError when the
    scheduler ended, no worker was left, or a run killed its workers.

    Args:
        address: of the scheduler, as ``tcp://host:8786`` or ``tls://host:8786``.
        shared: a folder that every worker has to see under the same path; None where the runs write nothing.

    Raises:
        ConfigurationError: there is no scheduler, its version or that of a worker is another, a worker has several
            threads, or does not see the folder.
        SessionError: the folder cannot be written.
    """
    with _connected(address) as client:
        _check_workers(client, address)
        if shared is not None:
            _check_shared(client, shared)
        yield lambda cells, work: _Handover(client, address, work).rows(cells)


@contextmanager
def _connected(address: str) -> Iterator[Client]:
    from distributed import Client

    hint = "Start one with: dask scheduler; and workers with: dask worker ADDRESS --nworkers auto --nthreads 1"
    try:
        _check_scheduler(asyncio.run(_greet(address)), address)
        client = Client(address, timeout=_CONNECT_s)
    except (OSError, ValueError, TypeError) as error:
        raise ConfigurationError(f"no scheduler answers ({error})", where=address, hint=hint) from error
    except MemoryError as error:  # words of another protocol, taken for the length of a message
        hint = "Give the scheduler's own port: 8786 by default, 8787 is its web page"
        raise ConfigurationError("something else than a scheduler answers", where=address, hint=hint) from error
    try:
        yield client
    finally:
        with suppress(OSError, TimeoutError):
            client.close(timeout=_CONNECT_s)


async def _greet(address: str) -> str:
    """The scheduler's version of Dask, asked once: a client would wait without end for whoever accepts a connection and
    says nothing, and fails in its own words at a scheduler of another version.

    Raises:
        OSError, ValueError, TypeError, MemoryError: nobody answers in time, or not as a scheduler does.
    """
    from distributed.comm import connect
    from distributed.core import send_recv
    from distributed.security import Security

    safety = Security().get_connection_args("client")
    try:
        comm = await asyncio.wait_for(connect(address, timeout=_CONNECT_s, **safety), 2 * _CONNECT_s)
        found = await asyncio.wait_for(send_recv(comm, op="versions"), 2 * _CONNECT_s)
    except TimeoutError as error:
        raise TimeoutError(f"silent for {2 * _CONNECT_s:.0f} s") from error
    await comm.close()
    return str(found["packages"]["distributed"])


# --- what a cluster has to be --------------------------------------------------------------------------------------


_INSTALL = "Install this version of the program, with all it needs, on the workers' machines"
_SAME_DASK = "Install the same version on every machine: runs and results are handed over in Dask's own form"


def _check_scheduler(found: str, address: str) -> None:
    import distributed

    if found != distributed.__version__:
        what = f"the scheduler has distributed {found}, this program {distributed.__version__}"
        raise ConfigurationError(what, where=address, hint=_SAME_DASK)


def _check_workers(client: Client, address: str) -> None:
    with suppress(TimeoutError):
        client.wait_for_workers(1, timeout=_CONNECT_s)
    threads = {name: worker["nthreads"] for name, worker in _workers(client).items()}
    if not threads:
        hint = f"Start some: dask worker {address} --nworkers auto --nthreads 1 --memory-limit 2GiB"
        raise ConfigurationError("the cluster has no workers", where=address, hint=hint)
    if several := [name for name, number in threads.items() if number != 1]:
        hint = "Start workers with --nthreads 1, and as many as there are cores: --nworkers auto"
        what = f"{len(several)} of {len(threads)} workers have several threads, {several[0]} among them"
        raise ConfigurationError(what, where=address, hint=hint)
    _check_dask(client, address)
    _check_program(client, address)


def _check_dask(client: Client, address: str) -> None:
    """Of the workers."""
    import distributed

    for name, worker in client.get_versions(check=False)["workers"].items():
        if (found := worker["packages"]["distributed"]) != distributed.__version__:
            what = f"worker {name} has distributed {found}, this program {distributed.__version__}"
            raise ConfigurationError(what, where=address, hint=_SAME_DASK)


def _check_program(client: Client, address: str) -> None:
    """Of the workers: one without it would end at its first run."""
    for name, found in client.run(_own_version, on_error="return").items():
        if isinstance(found, Exception):
            what = f"worker {name} cannot make the runs ({found})"
            raise ConfigurationError(what, where=address, hint=_INSTALL) from found
        if found != version():
            raise _another_version(found, address, f"worker {name}")


def _own_version() -> str:
    return version()


def _another_version(found: str, address: str, who: str = "a worker") -> ConfigurationError:
    hint = "Install the same version on every machine: results of several do not belong into one table"
    return ConfigurationError(f"{who} has another version of the program, {found}", where=address, hint=hint)


def _check_shared(client: Client, folder: Path) -> None:
    """Whether a file that is written here is there for every worker."""
    token = folder / f".seen-{uuid4().hex}"
    try:
        token.touch()
        seen = client.run(_sees, str(token))
    except OSError as error:
        raise SessionError(f"cannot be written ({error.strerror})", where=str(folder)) from error
    finally:
        token.unlink(missing_ok=True)
    if blind := [name for name, sees in seen.items() if not sees]:
        hint = "Give a folder on a file system that all machines share, mounted under the same path"
        raise ConfigurationError(f"worker {blind[0]} does not see this folder", where=str(folder), hint=hint)


def _sees(file: str) -> bool:
    return os.path.exists(file)  # noqa: PTH110 - of the worker's own file system


def _workers(client: Client) -> dict[str, Any]:
    found = client.scheduler_info(n_workers=-1)["workers"]
    assert isinstance(found, dict)
    return found


# --- the runs ------------------------------------------------------------------------------------------------------


class _Handover:
    """Hands a few runs at a time to the cluster, and takes their results.

    Args:
        client: connected.
        address: of the scheduler, for messages.
        work: runs one cell.
    """

    def __init__(self, client: Client, address: str, work: Work) -> None:
        self._client, self._address, self._work = client, address, work
        self._waiting: dict[Future[Any], Cell] = {}
        self._deadly: list[str] = []
        self._alone_since_s: float | None = None

    def rows(self, cells: Sequence[Cell]) -> Iterator[Row]:
        """Yields rows as they are finished. Raises SessionError and ConfigurationError."""
        coming = iter(cells)
        self._submit(islice(coming, _AHEAD * len(_workers(self._client))))
        while self._waiting:
            finished = self._finished()
            cells_of = [self._waiting.pop(future) for future in finished]
            self._submit(islice(coming, len(finished)))
            for future, cell in zip(finished, cells_of, strict=True):
                if (row := self._row(future, cell)) is not None:
                    yield row
        if self._deadly:
            hint = f"Memory may have run out: give workers more with --memory-limit. {_RESUMES}"
            raise SessionError(f"workers died in {'; '.join(self._deadly)}", where=self._address, hint=hint)

    def _submit(self, cells: Iterable[Cell]) -> None:
        extensions = os.environ.get(VARIABLE, "")
        for cell in cells:
            # Not pure: Dask would take equal calls for one, and keep their results.
            future = self._client.submit(_execute_on_worker, cell, self._work, version(), extensions, pure=False)
            self._waiting[future] = cell

    def _finished(self) -> list[Future[Any]]:
        """Runs that are finished, none after a while without any."""
        from distributed import CancelledError, wait

        with suppress(TimeoutError, CancelledError):
            wait(list(self._waiting), timeout=_LOOK_s, return_when="FIRST_COMPLETED")
        if self._client.status != "running":
            raise SessionError("the scheduler has ended", where=self._address, hint=f"Start it again. {_RESUMES}")
        done = [future for future in self._waiting if future.done()]
        if not done:
            self._check_workers_left()
        return done

    def _check_workers_left(self) -> None:
        """New workers may come; for a while."""
        if _workers(self._client):
            self._alone_since_s = None
            return
        now_s = time.monotonic()
        self._alone_since_s = self._alone_since_s or now_s
        if now_s - self._alone_since_s > _PATIENCE_s:
            what = f"no worker for {_PATIENCE_s:.0f} s"
            raise SessionError(what, where=self._address, hint=f"Start workers again. {_RESUMES}")

    def _row(self, future: Future[Any], cell: Cell) -> Row | None:
        """What came of a run; None where its workers died."""
        from distributed import KilledWorker

        if future.status == "cancelled":
            raise SessionError("the scheduler has lost the runs", where=self._address, hint=_RESUMES)
        error = future.exception()
        if isinstance(error, KilledWorker):
            self._deadly.append(cell.words())
            return None
        if error is not None:
            what = f"a worker cannot make the runs ({error})"
            raise ConfigurationError(what, where=self._address, hint=_INSTALL)
        found = future.result()
        if isinstance(found, Row):
            return found
        raise _another_version(found, self._address)


def _execute_on_worker(cell: Cell, work: Work, wanted: str, extensions: str) -> Row | str:
    """One run, on a worker; the worker's own version where it is another."""
    if version() != wanted:
        return version()
    if extensions:
        os.environ[VARIABLE] = extensions
        load_named_extensions()
    return execute(cell, work)
