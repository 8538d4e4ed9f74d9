"""The transducer behind every emulated ATI unit: six gauges that measure a wrench set by a test or a simulated
plant.
"""

from __future__ import annotations

import threading

import numpy as np

from drivers.ati.protocols.digital_calibration import DigitalCalibration
from drivers.core.contacts import Array

_COUNTS_PER_N, _LEVER_m = 1500.0, 0.006
_AHEAD = 256
_CALIBRATED = "2026-01-01"
RANGES = (12.0, 12.0, 17.0, 0.12, 0.12, 0.12)
"""Nano17 SI-12-0.12, newtons and newton metres."""


def emulated_calibration(serial: str = "FT00001") -> DigitalCalibration:
    """A calibration with a Nano17's structure: three beams, each with an axial and a tangential gauge."""
    angles = np.radians([90.0, 210.0, 330.0])
    rows = []
    for cosine, sine in zip(np.cos(angles), np.sin(angles), strict=True):
        rows.append([0.0, 0.0, 1.0, -sine / _LEVER_m, cosine / _LEVER_m, 0.0])
        rows.append([-sine, cosine, 0.0, 0.0, 0.0, 1.0 / _LEVER_m])
    matrix: Array = np.linalg.inv(_COUNTS_PER_N / 3.0 * np.array(rows)).astype(np.float64) * 1e6
    counts = (1_000_000, 1_000_000)
    return DigitalCalibration(serial, "SI-12-0.12", matrix, "N", "Nm", *counts, np.array(RANGES), _CALIBRATED)


class EmulatedSensor:
    """A sensor that measures the wrench it is given, with noise.

    Args:
        calibration: the calibration of its gauges; by default :func:`emulated_calibration`.
        noise_counts: noise of a gauge, one standard deviation.
        seed: for the noise.
    """

    def __init__(self, calibration: DigitalCalibration | None = None, noise_counts: float = 2.0, seed: int = 0) -> None:
        self.calibration = calibration or emulated_calibration()
        self._to_gauges = np.linalg.inv(self.calibration.working_matrix)
        self._noise, self._rng = noise_counts, np.random.default_rng(seed)
        self._lock = threading.Lock()
        self._wrench = np.zeros(6)
        self._ahead: list[tuple[tuple[int, ...], Array]] = []

    def press(self, wrench: Array) -> None:
        """Set the wrench to measure: N and N m, shape (6,), sensor frame. May be called from another thread."""
        with self._lock:
            self._wrench = np.array(wrench, dtype=np.float64)
            self._ahead.clear()

    def gauges(self) -> tuple[int, ...]:
        """A reading of gauges 0 to 5 in counts, limited to 16 bits like the converters."""
        return self._next()[0]

    def wrench(self) -> Array:
        """A reading as force and torque: N and N m, shape (6,)."""
        return self._next()[1]

    def _next(self) -> tuple[tuple[int, ...], Array]:
        """One reading; many are computed at a time, so that a stream of 7 kHz costs little."""
        with self._lock:
            if not self._ahead:
                exact = self._to_gauges @ self._wrench
                noisy = np.rint(exact + self._noise * self._rng.standard_normal((_AHEAD, 6)))
                counts = np.clip(noisy, -32768, 32767)
                wrenches = counts @ self.calibration.working_matrix.T
                self._ahead = list(zip(map(tuple, counts.astype(int).tolist()), wrenches, strict=True))
            return self._ahead.pop()
