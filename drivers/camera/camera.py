"""The camera under the table: a trigger out, one encoded picture back."""

from __future__ import annotations

from pydantic import Field

from drivers.camera.frames import Frame, decode_image
from drivers.links import Datagram, Link
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

    def capture(self) -> Frame:
        """Trigger and wait for the picture; one that was still on its way from before is left out.

        Raises:
            DeviceError: no picture within the time-out, or the link failed.
            CodecError: the picture can not be decoded.
        """
        self._link.receive()
        self._link.send(TRIGGER)
        deadline_ns = self._clock.now_ns() + round(1e6 * self._settings.timeout_ms)
        while not (arrived := self._link.receive()):
            if self._clock.now_ns() >= deadline_ns:
                raise DeviceError(
                    f"no picture within {self._settings.timeout_ms:.0f} ms",
                    where=self._link.name,
                    hint="Check the camera's power, cable and trigger",
                )
            self._clock.sleep_until_ns(self._clock.now_ns() + round(1e6 * self._settings.look_every_ms))
        return self.receive(arrived[-1])

    def receive(self, datagram: Datagram) -> Frame:
        """Decode one picture; changes nothing. Raises CodecError."""
        return Frame(datagram.stamp_ns, decode_image(datagram.payload))
