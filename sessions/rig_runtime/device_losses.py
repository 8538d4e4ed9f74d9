"""Data losses of a running session's devices, by kind, for its manifest and exit code.

The recorder knows the gaps of transports with numbered messages. A palm's are not numbered: only its driver knows in
which cycles no valid status arrived.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import suppress

from drivers.core.clock import NANOSECONDS
from drivers.core.errors import DeviceError
from sessions.perception.instruments import HandInstrument
from sessions.perception.interpreter import HAND_LINK, Interpreter


class DeviceLosses:
    """Counts over one session.

    Args:
        interpreter: knows undecodable messages and clock jumps.
        hand: knows its own losses.
    """

    def __init__(self, interpreter: Interpreter, hand: HandInstrument) -> None:
        self._interpreter, self._hand = interpreter, hand
        self._jumps: Counter[str] = Counter()
        self._ahead: set[str] = set()
        self._of_hand: dict[str, int] = {}

    def look(self) -> None:
        """Note clock jumps; at the end of a cycle, when every transport has been read."""
        ahead = set(self._interpreter.time.ahead_ns())
        self._jumps.update(ahead - self._ahead)
        self._ahead = ahead

    def conclude(self) -> None:
        """Read the hand's losses, while it is connected."""
        with suppress(DeviceError):  # one that is gone has ended the session
            self._of_hand = dict(self._hand.losses())

    def problems(self) -> Iterator[str]:
        """Clocks that are ahead now, as sentences beginning with the transport."""
        for transport, ahead_ns in self._interpreter.time.ahead_ns().items():
            ahead_s = ahead_ns / NANOSECONDS
            yield f"{transport}: its stamps are {ahead_s:.1f} s ahead of all others', its clock has jumped"

    def counts(self) -> dict[str, int]:
        """Losses by kind and transport, including zeros."""
        return {
            **{f"{kind} {HAND_LINK}": number for kind, number in self._of_hand.items()},
            **{f"undecodable {transport}": number for transport, number in self._interpreter.undecodable.items()},
            **{f"clock jumps {transport}": number for transport, number in self._jumps.items()},
        }
