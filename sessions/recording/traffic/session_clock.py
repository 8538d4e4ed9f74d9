"""The time of a session, derived from the stamps of all its messages, robust against a jump of one transport's clock.

What the program stamps itself (session events, state, sent bytes) is the session's clock. The stamps of received
messages come from elsewhere: a kernel, another process, a device. If the stamps of a transport whose clock has jumped
ahead were trusted, all others would look late or silent. So a received stamp far ahead counts only once another
transport confirms it.
"""

from __future__ import annotations

JUMP_ns = 500_000_000
"""A received stamp this far ahead of all others is a jump. A session that stalls for this long is stopped because its
fingertips are silent.
"""


class SessionClock:
    """Follows the newest stamp confirmed by more than one transport.

    Attributes:
        now_ns: the time; 0 before the first stamp.
    """

    def __init__(self) -> None:
        self.now_ns = 0
        self._sources: set[str | None] = set()
        self._doubted_ns: dict[str, int] = {}

    def on_stamp(self, stamp_ns: int) -> None:
        """Take a stamp of the program."""
        self._sources.add(None)
        self._advance(stamp_ns)

    def on_received(self, transport: str, stamp_ns: int) -> None:
        """Take the arrival stamp of a transport's message."""
        self._sources.add(transport)
        if self._is_believed(transport, stamp_ns):
            self._doubted_ns.pop(transport, None)
            self._advance(stamp_ns)
        else:
            self._doubted_ns[transport] = stamp_ns

    def ahead_ns(self) -> dict[str, int]:
        """Transports whose stamps have jumped ahead of all others, and how far, once every transport has sent
        something.
        """
        ahead_ns = {transport: stamp_ns - self.now_ns for transport, stamp_ns in self._doubted_ns.items()}
        return {transport: far_ns for transport, far_ns in ahead_ns.items() if far_ns > JUMP_ns}

    def _advance(self, stamp_ns: int) -> None:
        self.now_ns = max(self.now_ns, stamp_ns)

    def _is_believed(self, transport: str, stamp_ns: int) -> bool:
        if len(self._sources) == 1 or stamp_ns - self.now_ns <= JUMP_ns:
            return True
        others = (doubted_ns for other, doubted_ns in self._doubted_ns.items() if other != transport)
        return any(abs(stamp_ns - doubted_ns) <= JUMP_ns for doubted_ns in others)
