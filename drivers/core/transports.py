"""Transports, the interface to devices: they move byte strings and stamp their arrival.

A device never knows whether its transport is hardware, a simulated world or a recorded log.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import NamedTuple, Protocol, runtime_checkable

from drivers.core.clock import Clock
from drivers.core.errors import DeviceError


class Datagram(NamedTuple):
    """One received byte string and the time it arrived (session clock, nanoseconds)."""

    payload: bytes
    stamp_ns: int


class Transport(Protocol):
    """A two-way path for whole messages. ``name`` is the device's name in the rig and in recordings."""

    name: str

    def open(self) -> None:
        """Connect completely or not at all; can be repeated. Raises DeviceError."""

    def close(self) -> None:
        """Disconnect; idempotent."""

    def send(self, payload: bytes) -> None:
        """Send one message. Raises DeviceError if the device is disconnected."""

    def receive(self) -> list[Datagram]:
        """Everything that has arrived since the last call, oldest first; never blocks for long."""


def link_health(transport: Transport) -> tuple[str, ...]:
    """Problems below the messages that a transport's method ``health`` reports: unknown senders, drops, damaged frames.

    Empty for a transport without it. It is asked for in every cycle: a protocol would be checked fifty times as long.
    """
    health: Callable[[], tuple[str, ...]] | None = getattr(transport, "health", None)
    return () if health is None else health()


@runtime_checkable
class NamedTransport(Protocol):
    """A transport that knows, once it is open, which device is at its far end."""

    @property
    def identity(self) -> str:
        """Of the device, as text for people; empty if unknown."""


def link_identity(transport: Transport) -> str:
    """Which device a transport of any kind has found."""
    return transport.identity if isinstance(transport, NamedTransport) else ""


class Peer(Protocol):
    """The far end of an in-memory transport: a source and sink of device bytes."""

    def write(self, payload: bytes) -> None:
        """Take one message from the program."""

    def read(self) -> list[Datagram]:
        """All messages waiting for the program, with their arrival stamps."""


class MemoryTransport:
    """A transport to a peer in the same process."""

    def __init__(self, name: str, peer: Peer) -> None:
        self.name, self._peer, self._open = name, peer, False

    def open(self) -> None:
        self._open = True

    def close(self) -> None:
        self._open = False

    def send(self, payload: bytes) -> None:
        self._check_open()
        self._peer.write(payload)

    def receive(self) -> list[Datagram]:
        self._check_open()
        return self._peer.read()

    def _check_open(self) -> None:
        if not self._open:
            raise DeviceError("the transport is not open", where=self.name, hint="Connect the device first")


class ReplayTransport:
    """A transport that returns recorded messages: one recorded batch per ``receive``.

    ``sent`` keeps what the program wrote, so that a test can compare it with the recording.
    """

    def __init__(self, name: str, recorded: Iterable[Datagram | list[Datagram]]) -> None:
        self.name = name
        self._batches = deque([item] if isinstance(item, Datagram) else list(item) for item in recorded)
        self.sent: list[bytes] = []

    def open(self) -> None:
        """Nothing to open."""

    def close(self) -> None:
        """Nothing to close."""

    def send(self, payload: bytes) -> None:
        self.sent.append(payload)

    def receive(self) -> list[Datagram]:
        if not self._batches:
            raise DeviceError("the recording has ended", where=self.name, hint="Stop the session here")
        return self._batches.popleft()


class Tap(Protocol):
    """Sees every byte of a transport, before anything downstream can fail."""

    def on_transmitted(self, transport: str, payload: bytes, stamp_ns: int) -> None:
        """The program sent ``payload``."""

    def on_received(self, transport: str, payload: bytes, stamp_ns: int) -> None:
        """The device sent ``payload``, which arrived at ``stamp_ns``."""


class TappedTransport:
    """A transport whose traffic also goes to a tap (the session recorder)."""

    def __init__(self, transport: Transport, tap: Tap, clock: Clock) -> None:
        self.name, self._transport, self._tap, self._clock = transport.name, transport, tap, clock

    def open(self) -> None:
        self._transport.open()

    def close(self) -> None:
        self._transport.close()

    def send(self, payload: bytes) -> None:
        self._tap.on_transmitted(self.name, payload, self._clock.now_ns())
        self._transport.send(payload)

    def receive(self) -> list[Datagram]:
        datagrams = self._transport.receive()
        for datagram in datagrams:
            self._tap.on_received(self.name, datagram.payload, datagram.stamp_ns)
        return datagrams

    def health(self) -> tuple[str, ...]:
        """Problems of the tapped transport."""
        return link_health(self._transport)

    @property
    def identity(self) -> str:
        """Of the device at the tapped transport's far end."""
        return link_identity(self._transport)
