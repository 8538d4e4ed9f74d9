"""When the cycles of a hand start: on a grid of time, and after a late one not all at once."""

from __future__ import annotations

from drivers.core.clock import Clock

CLOSEST = 0.9
"""Share of the period that lies between two starts at least. A palm answers a command some 0.6 ms after it has come;
one that comes sooner finds its buffer full and brings back an empty status, and the cycle is lost."""


class CyclePace:
    """Waits for the start of each cycle.

    Starts lie a period apart. After a late one the next follow a little closer than that, until they are on the grid
    again; only what is late by whole periods is left out.

    Args:
        clock: the session's.
        cycle_ns: period, nanoseconds.
    """

    def __init__(self, clock: Clock, cycle_ns: int) -> None:
        self._clock, self._cycle_ns, self._closest_ns = clock, cycle_ns, round(CLOSEST * cycle_ns)
        self._due_ns = self._began_ns = clock.now_ns()

    def wait(self) -> tuple[int, int]:
        """Wait until the next cycle has to start.

        Returns:
            how late it starts, nanoseconds, and how many cycles before it were left out.
        """
        self._due_ns += self._cycle_ns
        self._clock.sleep_until_ns(max(self._due_ns, self._began_ns + self._closest_ns))
        self._began_ns = self._clock.now_ns()
        late_ns = self._began_ns - self._due_ns
        left_out = late_ns // self._cycle_ns
        self._due_ns += self._cycle_ns * left_out
        return late_ns, left_out
