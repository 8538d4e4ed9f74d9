"""A serial port as a transport: a stream of bytes, read in whatever pieces the port gives."""

from __future__ import annotations

import errno
import termios
from typing import Any

import serial

from drivers.core.clock import Clock
from drivers.core.errors import DeviceError
from drivers.core.transports import Datagram

_AT_ONCE = 1 << 16
_NO_PERMISSION = "Add yourself to the port's group (often dialout), then log in again"


class SerialTransport:
    """A serial port.

    Args:
        name: the device's name in the rig.
        port: path of the port, ``/dev/serial/by-id/...`` best.
        baud: bits per second.
        clock: the session's clock; a piece is stamped when it is read.
        parity: ``N``, ``E`` or ``O``. A pseudo terminal carries no parity: use ``N`` there.
    """

    def __init__(self, name: str, port: str, baud: int, clock: Clock, *, parity: str = "N") -> None:
        self.name, self.port, self.baud, self.parity = name, port, baud, parity
        self._clock = clock
        self._serial: Any = None

    def open(self) -> None:
        """Open the port for us alone. Repeatable. Raises DeviceError."""
        if self._serial is not None:
            return
        try:
            self._serial = serial.Serial(
                self.port, self.baud, parity=self.parity, timeout=0, write_timeout=1.0, exclusive=True
            )
        except (serial.SerialException, OSError, ValueError, termios.error) as error:
            raise _open_failure(self.name, self.port, self.baud, self.parity, error) from error

    def close(self) -> None:
        """Close the port; idempotent. A port that was pulled out is closed all the same."""
        port, self._serial = self._serial, None
        if port is not None:
            port.close()

    def send(self, payload: bytes) -> None:
        """Write bytes. Raises DeviceError."""
        try:
            self._open_port().write(payload)
        except (serial.SerialException, OSError, termios.error) as error:
            raise self._lost_error(error) from error

    def receive(self) -> list[Datagram]:
        """The bytes that wait, as one piece, or nothing. Raises DeviceError when the port is gone."""
        try:
            payload = self._open_port().read(_AT_ONCE)
        except (serial.SerialException, OSError, TypeError) as error:  # TypeError: closed by another thread
            raise self._lost_error(error) from error
        return [Datagram(payload, self._clock.now_ns())] if payload else []

    def _open_port(self) -> Any:
        if self._serial is None:
            raise DeviceError("the transport is not open", where=self.name, hint="Connect the device first")
        return self._serial

    def _lost_error(self, error: Exception) -> DeviceError:
        return DeviceError(
            f"the serial port {self.port} was disconnected ({error})", where=self.name, hint="Check plug and adapter"
        )


def _open_failure(name: str, port: str, baud: int, parity: str, error: Exception) -> DeviceError:
    """Why a port cannot be opened, in words."""
    number = error.args[0] if isinstance(error, termios.error) else getattr(error, "errno", None)
    if number == errno.ENOENT:
        return DeviceError(f"there is no serial port {port}", where=name, hint="Plug the adapter in; compare the path")
    if number == errno.EACCES:
        return DeviceError(f"no permission to open {port}", where=name, hint=_NO_PERMISSION)
    if number in (errno.EAGAIN, errno.EBUSY) or "lock" in str(error).lower():
        return DeviceError(f"{port} is in use by another program", where=name, hint="Close the other program")
    if number == errno.EINVAL:
        return DeviceError(
            f"{port} does not support {baud} baud with parity {parity}",
            where=name,
            hint="Use another adapter or another rate",
        )
    return DeviceError(f"{port} cannot be opened ({error})", where=name, hint="Is it the sensor's serial port?")
