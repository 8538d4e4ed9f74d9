"""Waits for a device, on a computer that may suspend the waiting program."""

from __future__ import annotations

from drivers.core.clock import NANOSECONDS

_LOOKS = 5


class Patience:
    """Measures how long a device has been waited for.

    While the program is suspended it cannot see an answer, and the device may have answered long ago. So at most a
    fifth of the waiting time is counted between two checks.

    Args:
        seconds: how long to wait.
        now_ns: present time.
    """

    def __init__(self, seconds: float, now_ns: int) -> None:
        self._left_ns = round(seconds * NANOSECONDS)
        self._longest_ns, self._looked_ns = max(self._left_ns // _LOOKS, 1), now_ns

    def over(self, now_ns: int) -> bool:
        """Whether the waiting time is over; every call counts as a check."""
        self._left_ns -= min(now_ns - self._looked_ns, self._longest_ns)
        self._looked_ns = now_ns
        return self._left_ns <= 0
