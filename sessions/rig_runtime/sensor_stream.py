"""A sensor that sends by itself, on a tapped transport."""

from __future__ import annotations

from drivers.core.transports import Transport, link_health
from sessions.perception.instruments import AskedInstrument, Instrument, NamedInstrument


class SensorStream:
    """A device that sends by itself, read without decoding: the tap of its transport already feeds Perception.

    Args:
        device: starts and ends the stream.
        transport: its tapped transport.
    """

    def __init__(self, device: Instrument, transport: Transport) -> None:
        self._device, self._transport = device, transport
        self._asked = device if isinstance(device, AskedInstrument) else None  # looked up once, not in every cycle

    def connect(self) -> None:
        """Start the stream. Raises DeviceError."""
        self._device.connect()

    def close(self) -> None:
        """End the stream; idempotent."""
        self._device.close()

    def poll(self) -> None:
        """Read what has arrived on the transport, and request more if the device needs it. Raises DeviceError."""
        self._transport.receive()
        if self._asked is not None:
            self._asked.ask()

    @property
    def identity(self) -> str:
        """See :class:`NamedInstrument`."""
        return self._device.identity if isinstance(self._device, NamedInstrument) else ""

    def health(self) -> tuple[str, ...]:
        """Problems of the transport; those of the readings are known to Perception's decoder."""
        return link_health(self._transport)
