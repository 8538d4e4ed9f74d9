"""A simulated rig that waits for the person: virtual time goes no faster than real time."""

from __future__ import annotations

from drivers.core.clock import NANOSECONDS, Clock

_GIVEN_UP_ns = NANOSECONDS // 5
"""Beyond this delay the simulation stays behind instead of catching up."""


class Pace:
    """Called with the simulated time after every cycle; waits while that is ahead.

    Args:
        clock: the real clock.
        factor: simulated seconds per real second.
    """

    def __init__(self, clock: Clock, factor: float = 1.0) -> None:
        self._clock, self._factor = clock, factor
        self._origin: tuple[int, int] | None = None

    def __call__(self, stamp_ns: int) -> None:
        now_ns = self._clock.now_ns()
        if self._origin is None:
            self._origin = (now_ns, stamp_ns)
        due_ns = self._origin[0] + round((stamp_ns - self._origin[1]) / self._factor)
        if due_ns > now_ns:
            self._clock.sleep_until_ns(due_ns)
        elif now_ns - due_ns > _GIVEN_UP_ns:
            self._origin = (now_ns, stamp_ns)
