"""An experiment's work whose process is killed, as by a system out of memory; importable by other processes."""

from __future__ import annotations

import os
import signal

from tactile_lab.experiments.cells import Cell


def die_at_four(cell: Cell) -> dict[str, float]:
    """Return a figure; the process with seed 4 is killed."""
    if cell.seed == 4:
        os.kill(os.getpid(), signal.SIGKILL)
    return {"value": float(cell.seed)}
