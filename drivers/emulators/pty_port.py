"""A serial device on a pseudo terminal, whose path can be opened like that of a serial adapter."""

from __future__ import annotations

import array
import contextlib
import fcntl
import os
import pty
import select
import struct
import tty

from drivers.emulators.ati.unit import Unit
from drivers.emulators.background import Background, Pace
from drivers.emulators.closing import Closing

_TCGETS2 = 0x802C542A
_SPEED_OFFSET = 40  # of the output speed in struct termios2
_POLL_s = 0.002
_HELD_s = 0.05  # of the fastest stream; a terminal holds 4 KiB


class PtyPort(Closing):
    """Serves one unit on a pseudo terminal until it is closed. A context manager.

    A pseudo terminal has no parity and no speed, but the speed that the client sets can be read. If it differs from the
    unit's, both sides receive garbage, as on a real line.

    Args:
        unit: the emulated device.
        baud: its baud rate.

    Attributes:
        path: of the port to open.
        overruns: messages that did not fit because nobody read the line.
    """

    def __init__(self, unit: Unit, baud: int) -> None:
        self.unit, self.overruns = unit, 0
        self._baud, self._pace = baud, Pace(_HELD_s)
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)
        self._closed = False
        self._loop = Background(f"unit on {self.path}", self._turn)

    def close(self) -> None:
        """Stop, and remove the port; idempotent."""
        if not self._closed:
            self._closed = True
            self._loop.close()
            os.close(self._master)
            os.close(self._slave)

    def _turn(self) -> None:
        select.select([self._master], [], [], _POLL_s)
        garbled = self._client_baud() != self._baud
        with contextlib.suppress(BlockingIOError):
            payload = os.read(self._master, 4096)
            for answer in self.unit.handle(_garbage(payload) if garbled else payload):
                self._write(answer, garbled)
        due = self._pace.due(self.unit.rate_hz)
        stream = b"".join(message for _ in range(due) if (message := self.unit.tick()) is not None)
        if stream:
            self._write(stream, garbled)

    def _write(self, payload: bytes, garbled: bool) -> None:
        try:
            written = os.write(self._master, _garbage(payload) if garbled else payload)
            self.overruns += written < len(payload)
        except BlockingIOError:
            self.overruns += 1

    def _client_baud(self) -> int:
        settings = array.array("B", bytes(64))
        fcntl.ioctl(self._master, _TCGETS2, settings, True)
        (baud,) = struct.unpack_from("I", settings, _SPEED_OFFSET)
        return int(baud)


def _garbage(payload: bytes) -> bytes:
    """The bytes received at a wrong baud rate: they always differ from those that were sent."""
    return bytes(byte ^ 0xA5 | 0x80 for byte in payload)
