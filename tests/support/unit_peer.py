"""An emulated sensor at the far end of a transport in memory."""

from __future__ import annotations

from collections import deque

from drivers.core.clock import Clock
from drivers.core.transports import Datagram
from drivers.emulators.ati.unit import Unit


class UnitPeer:
    """A unit without a wire; the code that advances the clock calls :meth:`tick`."""

    def __init__(self, unit: Unit, clock: Clock) -> None:
        self.unit, self._clock = unit, clock
        self._waiting: deque[Datagram] = deque(maxlen=100_000)

    def write(self, payload: bytes) -> None:
        """Process one message from the program."""
        self._waiting += (Datagram(answer, self._clock.now_ns()) for answer in self.unit.handle(payload))

    def tick(self) -> None:
        """Let the unit send the next message of its stream."""
        if (message := self.unit.tick()) is not None:
            self._waiting.append(Datagram(message, self._clock.now_ns()))

    def read(self) -> list[Datagram]:
        """All messages that wait for the program."""
        arrived = list(self._waiting)
        self._waiting.clear()
        return arrived
