"""Deadlines of the common cycle, on a fixed grid, and whether the session itself keeps them."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.core.clock import NANOSECONDS, Clock

_LATE_s, _LATE_CYCLES = 0.2, 10
_REMEMBERED_ns = 5 * NANOSECONDS


@dataclass
class CycleCounts:
    """Cycles run, cycles that ended after their deadline, and deadlines skipped because of that."""

    cycles: int = 0
    overruns: int = 0
    skipped: int = 0


@dataclass(frozen=True)
class _Turn:
    """From the end of one cycle to the end of the next: what was done between them, and with the devices."""

    ended_ns: int = 0
    between_ns: int = 0
    devices_ns: int = 0

    @property
    def length_ns(self) -> int:
        return self.between_ns + self.devices_ns


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
        self._waited_ns: int | None = None
        self._between_ns = 0
        self._longest = _Turn()

    def restart(self) -> None:
        """Restart the grid with the next cycle."""
        self._deadline_ns = self._waited_ns = None

    def begin(self) -> None:
        """Begin a cycle."""
        self.begun_ns = self._clock.now_ns()
        self._between_ns = 0 if self._waited_ns is None else self.begun_ns - self._waited_ns
        if self._deadline_ns is None:
            self._deadline_ns = self.begun_ns

    def wait(self) -> None:
        """End a cycle: wait for its deadline."""
        before_ns = self.begun_ns if self._deadline_ns is None else self._deadline_ns
        deadline_ns = before_ns + self._cycle_ns
        self._remember(turn := self._turn())
        late_ns = turn.ended_ns - deadline_ns
        self.counts.cycles += 1
        if late_ns > 0:
            missed = -(-late_ns // self._cycle_ns)
            self.counts.overruns += 1
            self.counts.skipped += missed
            deadline_ns += missed * self._cycle_ns
        self._clock.sleep_until_ns(deadline_ns)
        self._deadline_ns, self._waited_ns = deadline_ns, self._clock.now_ns()

    def lateness(self) -> str:
        """How late the session itself was in the last seconds, what it did meanwhile and what to do; "" if it was not.

        Asked for after a failure: what a late session has not read or sent in time looks like a silent device.
        """
        self._remember(self._turn())
        longest, usual_s = self._longest, self._cycle_ns / NANOSECONDS
        length_s = longest.length_ns / NANOSECONDS
        if length_s < max(_LATE_s, _LATE_CYCLES * usual_s):
            return ""
        busy = "busy with other work" if longest.between_ns > longest.devices_ns else "taking in what the devices sent"
        return (
            f"The session itself was late: {length_s:.1f} s {busy}, its cycle is {1000 * usual_s:g} ms. This computer "
            "is too slow or too busy: end other programs, or give the rig longer cycles (cycle_s, hand.cycle_s)"
        )

    def _turn(self) -> _Turn:
        """The turn that is going on."""
        now_ns = self._clock.now_ns()
        return _Turn(now_ns, self._between_ns, now_ns - self.begun_ns)

    def _remember(self, turn: _Turn) -> None:
        is_old = turn.ended_ns - self._longest.ended_ns > _REMEMBERED_ns
        if is_old or turn.length_ns > self._longest.length_ns:
            self._longest = turn
