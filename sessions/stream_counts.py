"""What went missing on each stream of a recording: gaps, late messages, and what the recorder itself had to drop."""

from __future__ import annotations

from collections import Counter

from sessions.raw_frames import DeviceStamp

LATE_ns = 100_000_000
"""A message counts as late when its stamp lies this far behind the newest one recorded."""


class StreamCounts:
    """Counters by topic.

    Attributes:
        messages: recorded.
        gaps: readings that the device numbered and that never came.
        late: messages that came so late that they stand out of order.
        dropped: messages that did not fit into the recorder's queue.
        unwritten: messages that the disk did not take when it failed.
    """

    def __init__(self) -> None:
        self.messages: Counter[str] = Counter()
        self.gaps: Counter[str] = Counter()
        self.late: Counter[str] = Counter()
        self.dropped: Counter[str] = Counter()
        self.unwritten: Counter[str] = Counter()
        self._next: dict[str, int] = {}

    def take(self, topic: str, behind_ns: int, device: DeviceStamp) -> None:
        """One message was recorded.

        Args:
            behind_ns: how far its stamp lies behind the newest one.
            device: what the device says of it. A counter that goes back has begun anew, which is no gap.
        """
        self.messages[topic] += 1
        if behind_ns > LATE_ns:
            self.late[topic] += 1
        if device.counter is not None:
            missing = device.counter - self._next.get(topic, device.counter)
            if missing > 0:
                self.gaps[topic] += missing
            self._next[topic] = device.counter + device.readings

    def losses(self) -> dict[str, int]:
        """Everything that is not zero, by kind and topic, for a session's record."""
        kinds = {
            "sequence gaps": self.gaps,
            "late": self.late,
            "queue drops": self.dropped,
            "unwritten": self.unwritten,
        }
        return {f"{kind} {topic}": n for kind, counts in kinds.items() for topic, n in sorted(counts.items()) if n}

    def plain(self) -> dict[str, dict[str, int]]:
        """All counters by topic, as plain data: of the links, and of whatever else lost anything."""
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
