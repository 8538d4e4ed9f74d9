"""Sends a request to a device and waits for its answer, over any transport and on any clock."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from drivers.ati.wires.patience import Patience
from drivers.core.clock import NANOSECONDS, Clock
from drivers.core.errors import CodecError
from drivers.core.transports import Datagram, Transport

Answer = TypeVar("Answer")

_STEP_ns = 1_000_000


class Conversation:
    """A transport while its device is being set up.

    Args:
        transport: open.
        clock: the session's clock.
        listen: receives every message, exactly as it does later during the session.
    """

    def __init__(self, transport: Transport, clock: Clock, listen: Callable[[Datagram], object]) -> None:
        self.name = transport.name
        self._transport, self._clock, self._listen = transport, clock, listen

    def send(self, payload: bytes) -> None:
        """Send one message. Raises DeviceError."""
        self._transport.send(payload)

    def wait(self, seconds: float) -> int:
        """Listen for a time; returns the number of bytes received. Raises DeviceError."""
        heard, end_ns = 0, self._clock.now_ns() + round(seconds * NANOSECONDS)
        while True:
            heard += self._hear()
            if (now_ns := self._clock.now_ns()) >= end_ns:
                return heard
            self._clock.sleep_until_ns(min(end_ns, now_ns + _STEP_ns))

    def until(self, look: Callable[[], Answer | None], seconds: float) -> Answer | None:
        """Listen until ``look`` returns a value; None if the time runs out first. Raises DeviceError."""
        patience = Patience(seconds, self._clock.now_ns())
        while True:
            self._hear()
            if (answer := look()) is not None:
                return answer
            if patience.over(now_ns := self._clock.now_ns()):
                return None
            self._clock.sleep_until_ns(now_ns + _STEP_ns)

    def _hear(self) -> int:
        heard = 0
        for datagram in self._transport.receive():
            heard += len(datagram.payload)
            try:
                self._listen(datagram)
            except CodecError:
                continue  # left over from before our request
        return heard
