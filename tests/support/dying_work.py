"""An experiment's work whose process is killed, as by a system out of memory; importable by other processes."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

from tactile_lab.experiments.cells import Cell


def die_at_four(cell: Cell, *, rows: Path) -> dict[str, float]:
    """Return a figure; the process with seed 4 is killed once the three others are among a file's rows."""
    if cell.seed == 4:
        while not all(f'"seed": {seed}' in rows.read_text() for seed in (1, 2, 3)):
            time.sleep(0.02)
        os.kill(os.getpid(), signal.SIGKILL)
    return {"value": float(cell.seed)}
