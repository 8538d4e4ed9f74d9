"""A Dask cluster as a laboratory starts it: a scheduler and workers in processes of their own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType

from tests.support.repository import REPOSITORY

_PATIENCE_s = 3.0
_NO_PROFILE = {"DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False"}
"""Workers otherwise keep, for an hour, what a session called in each of its seconds: some 0.2 MB each."""


class DaskCluster:
    """Runs while it is open.

    Args:
        folder: for the scheduler's file.
        workers: how many, with one thread each.
    """

    def __init__(self, folder: Path, workers: int) -> None:
        self._file = folder / "scheduler.json"
        here = ["--scheduler-file", str(self._file)]
        scheduler = ["scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", *here]
        worker = ["worker", *here, "--nworkers", str(workers), "--nthreads", "1", "--no-dashboard"]
        self._processes = [self._start(command, folder) for command in (scheduler, worker)]
        while not self.address:
            time.sleep(0.05)

    def _start(self, command: list[str], folder: Path) -> subprocess.Popen[bytes]:
        log = (folder / f"{command[0]}.log").open("wb")
        with log:
            whole = [sys.executable, "-m", "dask", *command]
            return subprocess.Popen(whole, cwd=REPOSITORY, stdout=log, stderr=log, env={**os.environ, **_NO_PROFILE})

    @property
    def address(self) -> str:
        """Of the scheduler; "" until it is known."""
        try:
            return str(json.loads(self._file.read_text())["address"])
        except (FileNotFoundError, json.JSONDecodeError):  # not there yet, or being written
            return ""

    def end_scheduler(self) -> None:
        """End the scheduler at once; workers go on looking for it."""
        self._processes[0].kill()
        self._processes[0].wait()

    def close(self) -> None:
        """End all processes at once."""
        for process in self._processes[::-1]:
            process.terminate()
            try:
                process.wait(_PATIENCE_s)
            except subprocess.TimeoutExpired:  # a worker that looks for its scheduler
                process.kill()
                process.wait()

    def __enter__(self) -> DaskCluster:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
