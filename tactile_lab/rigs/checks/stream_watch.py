"""Measures how regularly the messages of each device arrive."""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from drivers.core.clock import NANOSECONDS
from sessions.recording.traffic import schemas


class StreamWatch:
    """A sink for a recorder that keeps only the stamps of received messages."""

    def __init__(self) -> None:
        self._stamps_ns: dict[str, list[int]] = defaultdict(list)

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        """Note one message's stamp."""
        self._stamps_ns[topic].append(stamp_ns)

    def begin(self) -> None:
        """Forget what came while the other devices were connected, which holds up those connected before them."""
        self._stamps_ns.clear()

    def figures(self, transport: str) -> dict[str, float | str]:
        """Rate, jitter and longest gap of a transport's messages; empty for fewer than three messages.

        The jitter is the standard deviation of the intervals.
        """
        intervals_s = np.diff(self._stamps_ns.get(schemas.received_topic(transport), ())) / NANOSECONDS
        if len(intervals_s) < 2 or not intervals_s.sum():
            return {}
        return {
            "messages": float(len(intervals_s) + 1),
            "rate_Hz": float(len(intervals_s) / intervals_s.sum()),
            "jitter_ms": float(1e3 * intervals_s.std()),
            "longest_gap_ms": float(1e3 * intervals_s.max()),
        }


def in_words(figures: dict[str, float | str]) -> str:
    """Rate and jitter as text; empty if unknown."""
    if not {"rate_Hz", "jitter_ms"} <= set(figures):
        return ""
    return f"{figures['rate_Hz']:.0f} messages/s, jitter {figures['jitter_ms']:.2f} ms"
