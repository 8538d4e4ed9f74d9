"""Losses on each stream of a recording: gaps, late messages, and messages that the recorder dropped."""

from __future__ import annotations

from collections import Counter

from sessions.recording.traffic import schemas
from sessions.recording.traffic.raw_frames import DeviceStamp
from sessions.recording.traffic.session_clock import SessionClock

LATE_ns = 100_000_000
"""A message counts as late if its stamp is this far behind the session's time."""


class StreamCounts:
    """Counters by topic.

    Attributes:
        messages: recorded.
        gaps: readings that the device numbered but that never arrived.
        late: messages that arrived so late that they are out of order.
        dropped: messages that did not fit into the recorder's queue.
        unwritten: messages not written when the disk failed.
    """

    def __init__(self) -> None:
        self.messages: Counter[str] = Counter()
        self.gaps: Counter[str] = Counter()
        self.late: Counter[str] = Counter()
        self.dropped: Counter[str] = Counter()
        self.unwritten: Counter[str] = Counter()
        self._next: dict[str, int] = {}
        self._time = SessionClock()

    def take(self, topic: str, stamp_ns: int, device: DeviceStamp) -> None:
        """One message was recorded.

        Args:
            device: the device's own stamp. A counter that goes back has restarted, which is not a gap.
        """
        self.messages[topic] += 1
        if self._behind_ns(topic, stamp_ns) > LATE_ns:
            self.late[topic] += 1
        if device.counter is not None:
            missing = device.counter - self._next.get(topic, device.counter)
            if missing > 0:
                self.gaps[topic] += missing
            self._next[topic] = device.counter + device.readings

    def _behind_ns(self, topic: str, stamp_ns: int) -> int:
        if topic == schemas.STREAMS_TOPIC:
            return 0  # its stamp is this very time
        if (transport := schemas.stamper_of(topic)) is None:
            self._time.on_stamp(stamp_ns)
        else:
            self._time.on_received(transport, stamp_ns)
        return self.now_ns - stamp_ns

    @property
    def now_ns(self) -> int:
        """The session's time, robust against a transport's clock jump; 0 before any message."""
        return self._time.now_ns

    def losses(self) -> dict[str, int]:
        """All non-zero counts, by kind and topic, for a session's manifest."""
        kinds = {
            "sequence gaps": self.gaps,
            "late": self.late,
            "queue drops": self.dropped,
            "unwritten": self.unwritten,
        }
        return {f"{kind} {topic}": n for kind, counts in kinds.items() for topic, n in sorted(counts.items()) if n}

    def plain(self) -> dict[str, dict[str, int]]:
        """All counters by topic, as plain data: of the transports, and of other topics with losses."""
        lossy = {topic for counts in (self.gaps, self.late, self.dropped) for topic, number in counts.items() if number}
        topics = [topic for topic in sorted(self.messages) if topic.startswith("/link/") or topic in lossy]
        return {
            topic: {
                "messages": self.messages[topic],
                "gaps": self.gaps[topic],
                "late": self.late[topic],
                "dropped": self.dropped[topic],
            }
            for topic in topics
        }
