"""A sensor that sends by itself, on a link that is tapped."""

from __future__ import annotations

from drivers.links import Link, link_health
from sessions.instruments import AskedInstrument, Instrument, NamedInstrument


class SensorStream:
    """A device that sends by itself, emptied without decoding: the tap of its link has fed Perception already.

    Args:
        device: what starts and ends the stream.
        link: the tapped link it was built on.
    """

    def __init__(self, device: Instrument, link: Link) -> None:
        self._device, self._link = device, link
        self._asked = device if isinstance(device, AskedInstrument) else None  # looked up once, not in every cycle

    def connect(self) -> None:
        """Start the stream. Raises DeviceError."""
        self._device.connect()

    def close(self) -> None:
        """End the stream; idempotent."""
        self._device.close()

    def poll(self) -> None:
        """Take everything that waits on the link, and ask for more where the device needs it. Raises DeviceError."""
        self._link.receive()
        if self._asked is not None:
            self._asked.ask()

    @property
    def identity(self) -> str:
        """See :class:`NamedInstrument`."""
        return self._device.identity if isinstance(self._device, NamedInstrument) else ""

    def health(self) -> tuple[str, ...]:
        """What the link knows to be wrong; of the readings, the decoder that Perception has knows."""
        return link_health(self._link)
