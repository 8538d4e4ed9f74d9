"""The time of a session, from the stamps of all that happens in it, when the clock of one transport may jump.

What the program stamps itself (session events, state, sent bytes) is the session's clock. The stamps of what is
received come
from elsewhere: a kernel, another process, a device. Were a transport's word taken for the time when its clock has
jumped ahead, all the others would look late or silent. So a received stamp far ahead counts once somebody else comes
near it.
"""

from __future__ import annotations

JUMP_ns = 500_000_000
"""A received stamp this far ahead of all others is a jump. A session that itself stands still for so long is stopped
by its fingertips' silence."""


class SessionClock:
    """Follows the newest stamp that is not one transport's word alone.

    Attributes:
        now_ns: the time agreed on; 0 before the first stamp.
    """

    def __init__(self) -> None:
        self.now_ns = 0
        self._sources: set[str | None] = set()
        self._doubted_ns: dict[str, int] = {}

    def on_stamp(self, stamp_ns: int) -> None:
        """The program stamped something."""
        self._sources.add(None)
        self._advance(stamp_ns)

    def on_received(self, transport: str, stamp_ns: int) -> None:
        """Something of a transport was stamped when it came."""
        self._sources.add(transport)
        if self._is_believed(transport, stamp_ns):
            self._doubted_ns.pop(transport, None)
            self._advance(stamp_ns)
        else:
            self._doubted_ns[transport] = stamp_ns

    def ahead_ns(self) -> dict[str, int]:
        """Transports whose stamps have jumped ahead of all others, and how far, once each has been heard."""
        ahead_ns = {transport: stamp_ns - self.now_ns for transport, stamp_ns in self._doubted_ns.items()}
        return {transport: far_ns for transport, far_ns in ahead_ns.items() if far_ns > JUMP_ns}

    def _advance(self, stamp_ns: int) -> None:
        self.now_ns = max(self.now_ns, stamp_ns)

    def _is_believed(self, transport: str, stamp_ns: int) -> bool:
        if len(self._sources) == 1 or stamp_ns - self.now_ns <= JUMP_ns:
            return True
        others = (doubted_ns for other, doubted_ns in self._doubted_ns.items() if other != transport)
        return any(abs(stamp_ns - doubted_ns) <= JUMP_ns for doubted_ns in others)
