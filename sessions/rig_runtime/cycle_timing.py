"""Deadlines of the common cycle, on a fixed grid."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.core.clock import Clock


@dataclass
class CycleCounts:
    """Cycles run, cycles that ended after their deadline, and deadlines skipped because of that."""

    cycles: int = 0
    overruns: int = 0
    skipped: int = 0


class CycleTiming:
    """Keeps the cycle: a slow one does not shift later deadlines; missed ones are skipped.

    Args:
        clock: the session's.
        cycle_ns: period.
    """

    def __init__(self, clock: Clock, cycle_ns: int) -> None:
        self._clock, self._cycle_ns = clock, cycle_ns
        self.counts = CycleCounts()
        self.begun_ns = clock.now_ns()
        """Start of the newest cycle."""
        self._deadline_ns: int | None = None

    def restart(self) -> None:
        """Restart the grid with the next cycle."""
        self._deadline_ns = None

    def begin(self) -> None:
        """Begin a cycle."""
        self.begun_ns = self._clock.now_ns()
        if self._deadline_ns is None:
            self._deadline_ns = self.begun_ns

    def wait(self) -> None:
        """End a cycle: wait for its deadline."""
        before_ns = self.begun_ns if self._deadline_ns is None else self._deadline_ns
        deadline_ns = before_ns + self._cycle_ns
        late_ns = self._clock.now_ns() - deadline_ns
        self.counts.cycles += 1
        if late_ns > 0:
            missed = -(-late_ns // self._cycle_ns)
            self.counts.overruns += 1
            self.counts.skipped += missed
            deadline_ns += missed * self._cycle_ns
        self._clock.sleep_until_ns(deadline_ns)
        self._deadline_ns = deadline_ns
