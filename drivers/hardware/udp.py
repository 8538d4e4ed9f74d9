"""A UDP socket as a link: one device, known by its address, with reception stamped by the kernel."""

from __future__ import annotations

import socket
import struct
import sys
import time

from drivers.links import Datagram
from tactile_lab.clock import Clock
from tactile_lab.errors import DeviceError

SO_TIMESTAMPNS = 35
"""Linux: the kernel's stamp of each datagram, two 64-bit words (seconds and nanoseconds of the wall clock)."""

SO_RXQ_OVFL = 40
"""Linux: with each datagram the number of datagrams this socket has dropped so far, 32 bits."""

_STAMP, _DROPS = struct.Struct("@qq"), struct.Struct("@I")
_LARGEST = 65536
_ANCILLARY = socket.CMSG_SPACE(_STAMP.size) + socket.CMSG_SPACE(_DROPS.size)
_AT_ONCE = 20_000  # a flood must not hold the caller


class UdpLink:
    """Datagrams to and from one device. What comes from any other address is counted and left out.

    Args:
        name: the device's name in the rig.
        host, port: the device's address; ``host`` may be a name. Port 0 takes any port of that host, for a device
            that only sends.
        clock: the session's clock; its time is CLOCK_MONOTONIC on hardware.
        local: address to receive on; any interface and any free port unless given.
        receive_buffer: size of the kernel's buffer in bytes (4 MB hold half a second of a 7 kHz stream).

    Attributes:
        foreign: datagrams that came from another address.
        dropped: datagrams that the kernel threw away because the buffer was full.
        kernel_stamps: whether the operating system stamps arrivals; otherwise the stamps are those of reading.
    """

    def __init__(
        self,
        name: str,
        host: str,
        port: int,
        clock: Clock,
        *,
        local: tuple[str, int] = ("", 0),
        receive_buffer: int = 4 << 20,
    ) -> None:
        self.name = name
        self.foreign = self.dropped = 0
        self.kernel_stamps = False
        self._host, self._port, self._clock = host, port, clock
        self._local, self._buffer = local, receive_buffer
        self._socket: socket.socket | None = None
        self._address: tuple[str, int] = (host, port)
        self._newest_ns = 0

    def open(self) -> None:
        """Bind the receiving end, before anything is asked of the device. Repeatable.

        Raises:
            DeviceError: the name can not be resolved, or the local address can not be used.
        """
        if self._socket is not None:
            return
        made: socket.socket | None = None
        try:
            self._address = (socket.gethostbyname(self._host), self._port)
            made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            made.setblocking(False)
            made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, self._buffer)
            self.kernel_stamps = sys.platform == "linux" and _enabled(made, SO_TIMESTAMPNS)
            if sys.platform == "linux":
                _enabled(made, SO_RXQ_OVFL)
            made.bind(self._local)
        except OSError as error:
            if made is not None:
                made.close()
            raise self._failure(f"no UDP socket to {self._host}:{self._port} ({error.strerror or error})") from error
        self._socket, self._newest_ns = made, self._clock.now_ns()
        self.foreign = self.dropped = 0

    def close(self) -> None:
        """Close the socket; idempotent."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def send(self, payload: bytes) -> None:
        """Send one datagram. Raises DeviceError when the network refuses it."""
        try:
            self._open_socket().sendto(payload, self._address)
        except OSError as error:
            raise self._failure(f"cannot send to {self._host}:{self._port} ({error.strerror})") from error

    def receive(self) -> list[Datagram]:
        """All datagrams of the device that wait, oldest first, never blocking. Raises DeviceError."""
        wire, taken = self._open_socket(), []
        behind_ns = _wall_offset_ns(self._clock)
        for _ in range(_AT_ONCE):
            try:
                payload, ancillary, _, source = wire.recvmsg(_LARGEST, _ANCILLARY)
            except BlockingIOError:
                break
            except OSError as error:
                raise self._failure(f"lost {self._host}:{self._port} ({error.strerror})") from error
            stamp_ns = self._stamp(ancillary, behind_ns)
            if source[0] == self._address[0] and source[1] == (self._address[1] or source[1]):
                taken.append(Datagram(payload, stamp_ns))
            else:
                self.foreign += 1
        return taken

    def health(self) -> tuple[str, ...]:
        """Strangers and drops, in words; empty when there were none."""
        found = []
        if self.foreign:
            found.append(f"{self.foreign} datagrams from other addresses than {self._address[0]} left out")
        if self.dropped:
            found.append(f"{self.dropped} datagrams dropped by the kernel: the program reads too slowly")
        return tuple(found)

    def _stamp(self, ancillary: list[tuple[int, int, bytes]], behind_ns: int) -> int:
        """Arrival on the session's clock: never in the future, never before the one before it.

        The bounds hold the error of a wall clock that was set between arrival and reading.
        """
        stamp_ns = now_ns = self._clock.now_ns()
        for _, kind, data in ancillary:
            if kind == SO_TIMESTAMPNS:
                seconds, nanoseconds = _STAMP.unpack(data)
                stamp_ns = seconds * 1_000_000_000 + nanoseconds - behind_ns
            elif kind == SO_RXQ_OVFL:
                (self.dropped,) = _DROPS.unpack(data)
        self._newest_ns = max(self._newest_ns, min(stamp_ns, now_ns))
        return self._newest_ns

    def _open_socket(self) -> socket.socket:
        if self._socket is None:
            raise DeviceError("link is not open", where=self.name, hint="Connect the device first")
        return self._socket

    def _failure(self, what: str) -> DeviceError:
        return DeviceError(what, where=self.name, hint="Check address, cable and the network card's settings")


def _enabled(made: socket.socket, option: int) -> bool:
    """Ask the kernel for an extra; False where it does not have it."""
    try:
        made.setsockopt(socket.SOL_SOCKET, option, 1)
    except OSError:
        return False
    return True


def _wall_offset_ns(clock: Clock) -> int:
    """How far the wall clock, in which the kernel stamps, is ahead of the session's.

    Between two readings the program may be put aside for milliseconds: the pair closest together is taken.
    """
    closest_ns, offset_ns = 1 << 62, 0
    for _ in range(5):
        before_ns, wall_ns, after_ns = clock.now_ns(), time.time_ns(), clock.now_ns()
        if after_ns - before_ns < closest_ns:
            closest_ns, offset_ns = after_ns - before_ns, wall_ns - before_ns
        if closest_ns < 5_000:
            break
    return offset_ns
