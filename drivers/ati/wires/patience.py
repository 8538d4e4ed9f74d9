"""Waiting for a device, on a computer that may put the waiting program aside."""

from __future__ import annotations

from drivers.core.clock import NANOSECONDS

_LOOKS = 5


class Patience:
    """Time that a device was waited for.

    A program that is put aside does not wait: its device may have answered long ago, and that is seen at the next look
    only. So no more than a fifth of the patience counts between two looks.

    Args:
        seconds: how long to wait.
        now_ns: present time.
    """

    def __init__(self, seconds: float, now_ns: int) -> None:
        self._left_ns = round(seconds * NANOSECONDS)
        self._longest_ns, self._looked_ns = max(self._left_ns // _LOOKS, 1), now_ns

    def over(self, now_ns: int) -> bool:
        """Whether it is used up; every call counts as a look."""
        self._left_ns -= min(now_ns - self._looked_ns, self._longest_ns)
        self._looked_ns = now_ns
        return self._left_ns <= 0
