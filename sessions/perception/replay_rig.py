"""The replay rig: transports that play a recording to a device, so that any device runs on it as on hardware.

A device asks its transport for what has arrived; a :class:`RecordedTransport` returns the recorded messages that are
due by its clock. With a real clock that is the original pace, or a multiple; with a virtual clock a whole session takes
as long as decoding it. What the device sends is compared with what was sent in the recording.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from drivers.core.clock import Clock
from drivers.core.errors import DeviceError
from drivers.core.transports import Datagram
from sessions.recording.traffic import schemas
from sessions.recording.traffic.reader import TrafficReader


class RecordedTransport:
    """A transport that plays a recording.

    Args:
        name: name of the transport.
        received: what the device sent, in order.
        clock: the program's; the recording starts when the transport is first used.
        transmitted: what the program sent, in order.
        speed: multiple of the original pace.
        first_ns: stamp at which the recording starts; by default that of the first message.

    Attributes:
        sent: what the program sends now.
    """

    def __init__(
        self,
        name: str,
        received: Iterable[Datagram],
        clock: Clock,
        *,
        transmitted: Iterable[bytes] = (),
        speed: float = 1.0,
        first_ns: int | None = None,
    ) -> None:
        self.name, self._clock, self._speed = name, clock, speed
        self._waiting, self._then = deque(received), list(transmitted)
        self._first_ns = first_ns if first_ns is not None else (self._waiting[0].stamp_ns if self._waiting else 0)
        self._begun_ns: int | None = None
        self.sent: list[bytes] = []

    def open(self) -> None:
        """Nothing to open."""

    def close(self) -> None:
        """Nothing to close."""

    def send(self, payload: bytes) -> None:
        """Kept in ``sent``."""
        self._begin()
        self.sent.append(payload)

    def receive(self) -> list[Datagram]:
        """What has arrived by now, oldest first, with recorded stamps. Raises DeviceError at the end."""
        begun_ns = self._begin()
        if not self._waiting:
            raise DeviceError("the recording has ended", where=self.name, hint="Stop the session here")
        due_ns = self._first_ns + round((self._clock.now_ns() - begun_ns) * self._speed)
        found = []
        while self._waiting and self._waiting[0].stamp_ns <= due_ns:
            found.append(self._waiting.popleft())
        return found

    @property
    def as_then(self) -> bool:
        """Whether everything sent so far equals what was sent in the recording, byte for byte."""
        return self.sent == self._then[: len(self.sent)]

    def _begin(self) -> int:
        if self._begun_ns is None:
            self._begun_ns = self._clock.now_ns()
        return self._begun_ns


def recorded_links(reader: TrafficReader, clock: Clock, speed: float = 1.0) -> dict[str, RecordedTransport]:
    """All transports of a recording, with a common time. Raises SessionError."""
    received: dict[str, list[Datagram]] = {}
    transmitted: dict[str, list[bytes]] = {}
    stamps_ns = []
    for message in reader.messages():
        if not schemas.is_raw(message.topic):
            continue
        transport = schemas.link_of(message.topic)
        stamps_ns.append(message.stamp_ns)
        if schemas.received_transport(message.topic) is not None:
            received.setdefault(transport, []).append(Datagram(message.data, message.stamp_ns))
        else:
            transmitted.setdefault(transport, []).append(message.data)
    return {
        transport: RecordedTransport(
            transport,
            received.get(transport, ()),
            clock,
            transmitted=transmitted.get(transport, ()),
            speed=speed,
            first_ns=min(stamps_ns),
        )
        for transport in sorted(received.keys() | transmitted.keys())
    }
