"""Plays recorded messages at the original pace, faster, or as fast as possible."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from drivers.core.clock import Clock
from sessions.recording.traffic.reader import TrafficMessage

AS_FAST_AS_POSSIBLE = 0.0


def pace(messages: Iterable[TrafficMessage], speed: float, clock: Clock) -> Iterator[TrafficMessage]:
    """The same messages, each when it is due.

    Args:
        speed: 1 for the original pace, 4 for four times as fast, 0 for no waiting.
        clock: waits. There is no waiting for a stamp that goes back.
    """
    if speed == AS_FAST_AS_POSSIBLE:
        yield from messages
        return
    begun_ns, first_ns = clock.now_ns(), None
    for message in messages:
        first_ns = message.stamp_ns if first_ns is None else first_ns
        clock.sleep_until_ns(begun_ns + round((message.stamp_ns - first_ns) / speed))
        yield message
