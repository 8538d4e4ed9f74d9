"""Sessions of the estimator as runs for the workers of a cluster, with what each took."""

from __future__ import annotations

import os
import resource
import time
from typing import Any

from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.runs.tracking_runs import track_in_plane


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
