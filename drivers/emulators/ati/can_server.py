"""An emulated CAN device on any bus that python-can supports."""

from __future__ import annotations

import can

from drivers.emulators.ati.unit import Unit
from drivers.emulators.background import Background
from drivers.emulators.closing import Closing
from drivers.hardware.can_bus import CanFrame, decode_frame, encode_frame

_POLL_s = 0.01


class CanServer(Closing):
    """Serves one unit on a bus until it is closed, and closes the bus with it. A context manager."""

    def __init__(self, unit: Unit, bus: can.BusABC) -> None:
        self.unit, self._bus = unit, bus
        self._closed = False
        self._loop = Background("unit on CAN", self._turn)

    def close(self) -> None:
        """Leave the bus; idempotent."""
        if not self._closed:
            self._closed = True
            self._loop.close()
            self._bus.shutdown()

    def _turn(self) -> None:
        message = self._bus.recv(timeout=_POLL_s)
        if message is None or message.is_extended_id or message.is_error_frame or message.is_remote_frame:
            return
        for answer in self.unit.handle(encode_frame(CanFrame(message.arbitration_id, bytes(message.data)))):
            frame = decode_frame(answer)
            self._bus.send(can.Message(arbitration_id=frame.identifier, data=frame.data, is_extended_id=False))
