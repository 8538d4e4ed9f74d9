"""A network interface that stamps frames with their time of arrival, not with the time at which they are read."""

from __future__ import annotations

import contextlib
import socket
import struct

from drivers.core.clock import NANOSECONDS, Clock
from drivers.ethercat.ports import LARGEST_FRAME, RawPort
from drivers.hardware.batches import SO_TIMESTAMPNS
from drivers.hardware.udp import wall_offset_ns

_STAMP = struct.Struct("@qq")
_CONTROL_BYTES = socket.CMSG_SPACE(_STAMP.size)


class StampedPort(RawPort):
    """As :class:`~drivers.ethercat.ports.RawPort`, with the kernel's stamp of every frame.

    Args:
        interface: its name.
        clock: the clock of the stamps; CLOCK_MONOTONIC.

    Attributes:
        arrived_ns: when the last frame arrived; when it was read, if the kernel gives no stamp.
    """

    def __init__(self, interface: str, clock: Clock) -> None:
        super().__init__(interface)
        self._clock = clock
        self.arrived_ns = clock.now_ns()

    def open(self) -> None:
        super().open()
        with contextlib.suppress(OSError):  # a kernel that cannot stamp
            self._open().setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)

    def _next(self, raw: socket.socket) -> bytes:
        frame, told, _, _ = raw.recvmsg(LARGEST_FRAME, _CONTROL_BYTES)
        self.arrived_ns = self._clock.now_ns()
        for _, kind, data in told:
            if kind == SO_TIMESTAMPNS and len(data) == _STAMP.size:
                seconds, nanoseconds = _STAMP.unpack(data)
                stamp_ns = seconds * NANOSECONDS + nanoseconds - wall_offset_ns(self._clock)
                self.arrived_ns = min(stamp_ns, self.arrived_ns)
        return frame
