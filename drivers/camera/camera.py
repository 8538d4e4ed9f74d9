"""The camera under the table: a trigger out, one picture with its markers back; some send markers all the time."""

from __future__ import annotations

from pydantic import Field

from drivers.camera.frames import Frame
from drivers.camera.packet import decode_packet
from drivers.links import Datagram, Link, link_health
from tactile_lab.clock import Clock
from tactile_lab.errors import DeviceError
from tactile_lab.strict_yaml import StrictModel

TRIGGER = b"TRIGGER"


class CameraDeviceSettings(StrictModel):
    """How long to wait for a picture, and how often to look."""

    timeout_ms: float = Field(default=1000.0, gt=0.0)
    look_every_ms: float = Field(default=2.0, gt=0.0)


class Camera:
    """A triggered camera."""

    def __init__(self, link: Link, clock: Clock, settings: CameraDeviceSettings | None = None) -> None:
        self._link, self._clock, self._settings = link, clock, settings or CameraDeviceSettings()
        self._connected = False

    def connect(self) -> None:
        """Open the link; repeatable. Raises DeviceError."""
        if not self._connected:
            self._link.open()
            self._connected = True

    def close(self) -> None:
        """Close the link; idempotent."""
        if self._connected:
            self._connected = False
            self._link.close()

    def poll(self) -> None:
        """Take what the camera has sent by itself, so that it is recorded in time. Raises DeviceError."""
        self._link.receive()

    def capture(self) -> Frame:
        """Trigger and wait for the picture; one that was still on its way from before is left out.

        Raises:
            DeviceError: no picture within the time-out, or the link failed.
            CodecError: the picture can not be decoded.
        """
        self._link.receive()
        self._link.send(TRIGGER)
        deadline_ns = self._clock.now_ns() + round(1e6 * self._settings.timeout_ms)
        while (frame := self._newest_picture()) is None:
            if self._clock.now_ns() >= deadline_ns:
                raise DeviceError(
                    f"no picture within {self._settings.timeout_ms:.0f} ms",
                    where=self._link.name,
                    hint="Check the camera's power, cable and trigger",
                )
            self._clock.sleep_until_ns(self._clock.now_ns() + round(1e6 * self._settings.look_every_ms))
        return frame

    def _newest_picture(self) -> Frame | None:
        frames = [self.receive(datagram) for datagram in self._link.receive()]
        return next((frame for frame in reversed(frames) if frame.image is not None), None)

    def receive(self, datagram: Datagram) -> Frame:
        """Decode what the camera sent; changes nothing. Raises CodecError."""
        return decode_packet(datagram)

    def health(self) -> tuple[str, ...]:
        """What the camera's link knows to be wrong, in words."""
        return link_health(self._link)
