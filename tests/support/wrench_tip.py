"""A fingertip for tests of what is computed from the forces of a carry."""

from __future__ import annotations

import numpy as np

from drivers.core.fingertip import TipTouches


class WrenchTip:
    """A force fingertip whose readings are its wrench; only what carrying asks of one."""

    drift = np.zeros(6)

    def reading(self) -> np.ndarray:
        return np.zeros(6)

    def touches(self, readings: np.ndarray, world_R_distal: np.ndarray) -> TipTouches:
        """It tells of no contact where its wrench is."""
        nothing, never = np.zeros((len(readings), 3)), np.zeros(len(readings), dtype=bool)
        return TipTouches(nothing, nothing, np.zeros(len(readings)), nothing, never, never)

    def wrenches(self, readings: np.ndarray, world_R_distal: np.ndarray) -> np.ndarray:
        return readings
