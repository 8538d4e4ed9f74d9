"""Runs for the workers of a cluster, which import them: nothing here loads an estimator."""

from __future__ import annotations

import os
import signal

from drivers.core.errors import TrackingError
from tactile_lab.experiments.cells import Cell


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
