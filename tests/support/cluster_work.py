"""Runs for the workers of a cluster, which import them."""

from __future__ import annotations

import os
import resource
import signal
import time
from typing import Any

from drivers.core.errors import TrackingError
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.runs.tracking_runs import track_in_plane


def square(cell: Cell) -> dict[str, float]:
    """Figures that depend on the cell alone; one of them fails."""
    if cell.seed == 1 and cell["noise"] == 50:
        raise TrackingError("nothing fits")
    return {"value": float(cell["noise"] * cell.seed)}


def named(cell: Cell) -> dict[str, float]:
    """The process that made it."""
    return {"process": os.getpid()}


def deadly(cell: Cell) -> dict[str, float]:
    """One of the runs kills whoever makes it."""
    if cell.seed == 4 and cell["noise"] == 25:
        os.kill(os.getpid(), signal.SIGKILL)
    return {}


def sees_nothing(file: str) -> bool:
    """As a worker that does not share the folder."""
    return False


def measured(cell: Cell) -> dict[str, Any]:
    """A session's figures, the process that made it, when it began and ended, its thread's processor time, and the most
    memory that its process has held.
    """
    begun_s, used_s = time.monotonic(), time.thread_time()
    figures = track_in_plane(cell)
    spent_s, ended_s = time.thread_time() - used_s, time.monotonic()
    most_kB = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    made_by = {"process": os.getpid(), "resident_MB": most_kB / 1024}
    return {**figures, **made_by, "begun_s": begun_s, "ended_s": ended_s, "cpu_s": spent_s}
