"""A loop in a thread of its own, begun and ended in order, and the pace of a stream."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from drivers.emulators.closing import Closing


class Background(Closing):
    """Calls ``turn`` again and again until it is closed. A context manager; closing is idempotent and waits.

    Args:
        name: of the thread.
        turn: one turn, a few milliseconds at most.
    """

    def __init__(self, name: str, turn: Callable[[], None]) -> None:
        self._turn, self._ending = turn, threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the loop and wait for it."""
        self._ending.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._ending.is_set():
            self._turn()


class Pace:
    """How many messages of a stream are due. What a busy machine has missed is made up, for a time at most.

    Args:
        longest_s: that time: what the line to the reader holds.
    """

    def __init__(self, longest_s: float = 0.5) -> None:
        self._longest_s, self._last_s = longest_s, time.monotonic()
        self._owed = 0.0

    def due(self, rate_hz: float) -> int:
        """Messages due since the last call."""
        now_s = time.monotonic()
        self._owed += min(now_s - self._last_s, self._longest_s) * rate_hz
        self._last_s = now_s
        count = int(self._owed)
        self._owed -= count
        return count

    def wait_s(self, rate_hz: float) -> float:
        """Time until the next message is due, seconds."""
        return max((1.0 - self._owed) / rate_hz - (time.monotonic() - self._last_s), 0.0)

    def rest(self) -> None:
        """Nothing to do for a moment."""
        time.sleep(0.001)
