"""What an emulated device is: bytes in, bytes out, and a stream; on which wire, it does not know."""

from __future__ import annotations

from collections import deque
from typing import Protocol

from drivers.links import Datagram
from tactile_lab.clock import Clock


class Unit(Protocol):
    """One emulated device."""

    def handle(self, payload: bytes) -> list[bytes]:
        """Take what the program sent; the answers."""

    def tick(self) -> bytes | None:
        """The next message of the stream; None while there is none."""

    @property
    def rate_hz(self) -> float:
        """Messages of the stream per second."""


class UnitPeer:
    """A unit at the far end of an in-memory link; whoever drives the clock calls :meth:`tick`."""

    def __init__(self, unit: Unit, clock: Clock) -> None:
        self.unit, self._clock = unit, clock
        self._waiting: deque[Datagram] = deque(maxlen=100_000)

    def write(self, payload: bytes) -> None:
        """Take one message from the program."""
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
