"""A wrapper around any transport that lets one fault strike, and counts how often."""

from __future__ import annotations

import numpy as np

from drivers.core.errors import DeviceError
from drivers.core.transports import Datagram, Transport, link_health
from tests.support.faults.kinds import Fault, Injectable
from tests.support.faults.schedule import When


class FaultyTransport:
    """Any transport, with a fault.

    Args:
        transport: the transport to wrap.
        fault: the fault to inject.
        when: which messages it strikes.
        seed: for random schedules.

    Attributes:
        injected: how often the fault struck.
        received: messages that came from the wrapped transport while armed.
        armed: whether the fault can strike; while it is not, messages pass.
    """

    def __init__(self, transport: Transport, fault: Fault, when: When | None = None, seed: int = 0) -> None:
        self.name, self._transport, self.fault = transport.name, transport, fault
        self.injected = self.received = 0
        self._when, self._rng = when or When(), np.random.default_rng(seed)
        self.armed = True
        self._unplugged = False

    def open(self) -> None:
        """Open the wrapped transport; plugs an unplugged wire in."""
        self._transport.open()
        self._unplugged = False

    def close(self) -> None:
        """Close the wrapped transport."""
        self._transport.close()

    def send(self, payload: bytes) -> None:
        """Send one message. Raises DeviceError, also while unplugged."""
        self._check_plug()
        self._transport.send(payload)

    def receive(self) -> list[Datagram]:
        """Received messages, including faults. Raises DeviceError, also while unplugged."""
        self._check_plug()
        if not self.armed:
            return self._transport.receive()
        arrived = self.fault.release_held()
        for datagram in self._transport.receive():
            arrived += self._treat(datagram)
        return arrived

    def health(self) -> tuple[str, ...]:
        """Problems that the wrapped transport reports."""
        return link_health(self._transport)

    def inject(self, fault: str) -> None:
        """Pass a far end's fault on. Raises ValueError if the wrapped transport does not support it."""
        if not isinstance(self._transport, Injectable):
            raise ValueError(f"{self.name}: the far end of this link has no fault {fault!r}")
        self._transport.inject(fault)

    def _treat(self, datagram: Datagram) -> list[Datagram]:
        struck = self._when.strikes(self.received, self.injected, self._rng)
        self.received += 1
        if not struck:
            return self.fault.spare(datagram)
        self.injected += 1
        try:
            return self.fault.strike(datagram)
        except DeviceError as error:
            self._unplugged = True
            raise DeviceError(error.what, where=self.name, hint=error.hint) from error

    def _check_plug(self) -> None:
        if self._unplugged:
            raise DeviceError("the wire is unplugged", where=self.name, hint="Plug it in and connect again")
