"""A fingertip for tests of what is computed from the forces of a carry."""

from __future__ import annotations

import numpy as np


class WrenchTip:
    """A force fingertip whose readings are its wrench; only what carrying asks of one."""

    drift = np.zeros(6)

    def reading(self) -> np.ndarray:
        return np.zeros(6)

    def touches(self, readings: np.ndarray, world_R_distal: np.ndarray) -> None:
        raise AssertionError("contacts are not asked for")

    def wrenches(self, readings: np.ndarray, world_R_distal: np.ndarray) -> np.ndarray:
        return readings
