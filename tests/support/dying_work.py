"""Work of an experiment whose process is killed, as by a system that is out of memory; found by other processes."""

from __future__ import annotations

import os
import signal

from tactile_lab.experiments.cells import Cell


def die_at_four(cell: Cell) -> dict[str, float]:
    """A figure; the process that is given seed 4 is killed."""
    if cell.seed == 4:
        os.kill(os.getpid(), signal.SIGKILL)
    return {"value": float(cell.seed)}
