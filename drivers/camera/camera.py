"""The camera under the table: it answers a trigger with one picture and its markers; some also stream markers."""

from __future__ import annotations

from pydantic import Field

from drivers.camera.frames import Frame
from drivers.camera.packet import decode_packet
from drivers.core.clock import Clock
from drivers.core.configuration import StrictModel
from drivers.core.errors import DeviceError
from drivers.core.transports import Datagram, Transport, link_health

TRIGGER = b"TRIGGER"


class CameraDeviceSettings(StrictModel):
    """How long to wait for a picture, and how often to check for it."""

    timeout_ms: float = Field(default=1000.0, gt=0.0)
    look_every_ms: float = Field(default=2.0, gt=0.0)


class Camera:
    """A triggered camera."""

    def __init__(self, transport: Transport, clock: Clock, settings: CameraDeviceSettings | None = None) -> None:
        self._transport, self._clock, self._settings = transport, clock, settings or CameraDeviceSettings()
        self._connected = False
        self._asked_ns: int | None = None
        self._arrived: list[Datagram] = []

    def connect(self) -> None:
        """Open the transport; repeatable. Raises DeviceError."""
        if not self._connected:
            self._transport.open()
            self._connected = True

    def close(self) -> None:
        """Close the transport; idempotent."""
        if self._connected:
            self._connected = False
            self._transport.close()

    def poll(self) -> None:
        """Receive what the camera has streamed, so that it is recorded in time. Raises DeviceError."""
        arrived = self._transport.receive()
        if self._asked_ns is not None:
            self._arrived += arrived

    def ask(self) -> None:
        """Trigger the camera; :meth:`take_picture` returns the picture. Pictures of earlier triggers are ignored.

        Raises:
            DeviceError: the transport failed.
        """
        self._transport.receive()
        self._transport.send(TRIGGER)
        self._asked_ns, self._arrived = self._clock.now_ns(), []

    def take_picture(self) -> Frame | None:
        """The requested picture, returned once; None until it has arrived. Never waits.

        Raises:
            DeviceError: no picture was requested, none came within the time-out, or the transport failed.
            CodecError: what arrived is no picture.
        """
        if self._asked_ns is None:
            raise DeviceError("no picture was requested", where=self._transport.name, hint="Request one first")
        self.poll()
        arrived, self._arrived = self._arrived, []
        frames = [self.receive(datagram) for datagram in arrived]
        frame = next((frame for frame in reversed(frames) if frame.picture is not None), None)
        if frame is None and self._clock.now_ns() - self._asked_ns >= 1e6 * self._settings.timeout_ms:
            raise DeviceError(
                f"no picture within {self._settings.timeout_ms:.0f} ms",
                where=self._transport.name,
                hint="Check the camera's power, cable and trigger",
            )
        if frame is not None:
            self._asked_ns = None
        return frame

    def capture(self) -> Frame:
        """Trigger the camera and wait for the picture; see :meth:`ask` and :meth:`take_picture`."""
        self.ask()
        while (frame := self.take_picture()) is None:
            self._clock.sleep_until_ns(self._clock.now_ns() + round(1e6 * self._settings.look_every_ms))
        return frame

    def receive(self, datagram: Datagram) -> Frame:
        """Decode what the camera sent; changes nothing. Raises CodecError."""
        return decode_packet(datagram)

    def health(self) -> tuple[str, ...]:
        """Problems that the camera's transport reports, in plain English."""
        return link_health(self._transport)
