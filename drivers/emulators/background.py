"""A loop in a separate thread that is started and ended in an orderly way, and the timing of a stream."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from drivers.emulators.closing import Closing


class Background(Closing):
    """Calls ``turn`` repeatedly until it is closed. A context manager; closing is idempotent and waits for the end.

    Args:
        name: of the thread.
        turn: one iteration, which may take a few milliseconds at most.
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
    """Computes how many messages of a stream are due. Delays of a busy machine are caught up, within a limit.

    Args:
        longest_s: the longest delay to catch up: what the buffer to the reader can hold.
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
        """Sleep until there can be something to do."""
        time.sleep(0.001)
