"""The time of a session, from the stamps of all that happens in it, when the clock of one link may jump.

What the program stamps itself (marks, state, sent bytes) is the session's clock. The stamps of what is received come
from elsewhere: a kernel, another process, a device. Were a link's word taken for the time when its clock has jumped
ahead, all the others would look late or silent. So a received stamp far ahead counts once somebody else comes near it.
"""

from __future__ import annotations

JUMP_ns = 500_000_000
"""A received stamp this far ahead of all others is a jump. A session that itself stands still for so long is stopped
by its fingertips' silence."""


class AgreedTime:
    """Follows the newest stamp that is not one link's word alone.

    Attributes:
        now_ns: the time agreed on; 0 before the first stamp.
    """

    def __init__(self) -> None:
        self.now_ns = 0
        self._sources: set[str | None] = set()
        self._doubted_ns: dict[str, int] = {}

    def stamped(self, stamp_ns: int) -> None:
        """The program stamped something."""
        self._sources.add(None)
        self._advance(stamp_ns)

    def received(self, link: str, stamp_ns: int) -> None:
        """Something of a link was stamped when it came."""
        self._sources.add(link)
        if self._is_believed(link, stamp_ns):
            self._doubted_ns.pop(link, None)
            self._advance(stamp_ns)
        else:
            self._doubted_ns[link] = stamp_ns

    def ahead_ns(self) -> dict[str, int]:
        """Links whose stamps have jumped ahead of everybody else's, and how far; once each link has been heard."""
        ahead_ns = {link: stamp_ns - self.now_ns for link, stamp_ns in self._doubted_ns.items()}
        return {link: far_ns for link, far_ns in ahead_ns.items() if far_ns > JUMP_ns}

    def _advance(self, stamp_ns: int) -> None:
        self.now_ns = max(self.now_ns, stamp_ns)

    def _is_believed(self, link: str, stamp_ns: int) -> bool:
        if len(self._sources) == 1 or stamp_ns - self.now_ns <= JUMP_ns:
            return True
        others = (doubted_ns for other, doubted_ns in self._doubted_ns.items() if other != link)
        return any(abs(stamp_ns - doubted_ns) <= JUMP_ns for doubted_ns in others)
