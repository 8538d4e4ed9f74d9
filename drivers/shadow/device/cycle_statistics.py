"""How punctual a cycle is: lateness of its starts, and cycles that were left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_BIN_ns, _BINS = 1_000, 50_000


@dataclass(frozen=True)
class Punctuality:
    """Lateness of cycle starts, microseconds.

    Attributes:
        cycles: how many.
        left_out: cycles that were skipped because one before took too long.
        median_us, p99_us, worst_us: of the lateness; the first two are exact to a microsecond, up to 50 ms.
    """

    cycles: int
    left_out: int
    median_us: float
    p99_us: float
    worst_us: float

    def __str__(self) -> str:
        """In words."""
        return (
            f"{self.cycles} cycles, {self.left_out} skipped, started late by {self.median_us:.0f} us (median), "
            f"{self.p99_us:.0f} us (99 %), {self.worst_us:.0f} us (worst)"
        )


class CycleStatistics:
    """Gathers lateness in constant memory."""

    def __init__(self) -> None:
        self._counts = np.zeros(_BINS, dtype=np.int64)
        self.cycles = self._left_out = self._worst_ns = 0

    def add(self, lateness_ns: int, left_out: int = 0) -> None:
        """Count a cycle by its delay, and the cycles skipped before it."""
        self._counts[min(max(lateness_ns, 0) // _BIN_ns, _BINS - 1)] += 1
        self.cycles += 1
        self._left_out += left_out
        self._worst_ns = max(self._worst_ns, lateness_ns)

    def summary(self) -> Punctuality:
        """What was gathered so far."""
        return Punctuality(
            self.cycles, self._left_out, self._quantile_us(0.5), self._quantile_us(0.99), self._worst_ns / 1000
        )

    def _quantile_us(self, share: float) -> float:
        if not self.cycles:
            return 0.0
        reached = int(np.searchsorted(np.cumsum(self._counts), share * self.cycles))
        return min(reached, _BINS - 1) * _BIN_ns / 1000
