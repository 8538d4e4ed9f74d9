"""A UDP socket as a transport: one device, known by its address, with reception stamped by the kernel."""

from __future__ import annotations

import ipaddress
import socket
import time

import numpy as np

from drivers.core.clock import Clock
from drivers.core.errors import DeviceError
from drivers.core.transports import Datagram
from drivers.hardware.batches import SO_RXQ_OVFL, SO_TIMESTAMPNS, Batch, BatchReceiver, can_batch

_LARGEST = 65536
_BATCHES = 160  # a flood must not hold the caller


class UdpTransport:
    """Datagrams to and from one device. Datagrams from other addresses are counted and ignored.

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
        self._batches: BatchReceiver | None = None
        self._address: tuple[str, int] = (host, port)
        self._newest_ns = 0

    def open(self) -> None:
        """Bind the receiving end, before anything is asked of the device. Repeatable.

        Raises:
            DeviceError: the name cannot be resolved, or the local address cannot be used.
        """
        if self._socket is not None:
            return
        made: socket.socket | None = None
        try:
            self._address = (socket.gethostbyname(self._host), self._port)
            made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            made.setblocking(False)
            made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, self._buffer)
            self.kernel_stamps = can_batch() and _enable(made, SO_TIMESTAMPNS)
            if can_batch():
                _enable(made, SO_RXQ_OVFL)
            made.bind(self._local)
        except OSError as error:
            if made is not None:
                made.close()
            raise self._failure(
                f"cannot open a UDP socket to {self._host}:{self._port} ({error.strerror or error})"
            ) from error
        self._socket, self._newest_ns = made, self._clock.now_ns()
        self._batches = BatchReceiver(made) if can_batch() else None
        self.foreign = self.dropped = 0

    def close(self) -> None:
        """Close the socket; idempotent."""
        if self._socket is not None:
            self._socket.close()
            self._socket = self._batches = None

    def send(self, payload: bytes) -> None:
        """Send one datagram. Raises DeviceError when the network refuses it."""
        try:
            self._open_socket().sendto(payload, self._address)
        except OSError as error:
            raise self._failure(f"cannot send to {self._host}:{self._port} ({error.strerror})") from error

    def receive(self) -> list[Datagram]:
        """All datagrams of the device that wait, oldest first, never blocking. Raises DeviceError."""
        wire, taken = self._open_socket(), list[Datagram]()
        behind_ns = wall_offset_ns(self._clock)
        for _ in range(_BATCHES):
            try:
                batch = self._batches.receive() if self._batches else _singly(wire)
            except OSError as error:
                raise self._failure(f"lost the connection to {self._host}:{self._port} ({error.strerror})") from error
            if not batch.payloads:
                break
            taken += self._take(batch, behind_ns)
        return taken

    def health(self) -> tuple[str, ...]:
        """Strangers and drops, in words; empty when there were none."""
        found = []
        if self.foreign:
            found.append(f"{self.foreign} datagrams from other addresses than {self._address[0]} ignored")
        if self.dropped:
            found.append(f"{self.dropped} datagrams dropped by the kernel: the program reads too slowly")
        return tuple(found)

    def _take(self, batch: Batch, behind_ns: int) -> list[Datagram]:
        """The device's own of a batch, stamped on the session's clock: never in the future, never going back.

        The bounds hold the error of a wall clock that was set between arrival and reading.
        """
        self.dropped = self.dropped if batch.drops is None else batch.drops
        now_ns = self._clock.now_ns()
        stamps_ns = np.where(batch.walls_ns > 0, np.minimum(batch.walls_ns - behind_ns, now_ns), now_ns)
        stamps_ns = np.maximum(np.maximum.accumulate(stamps_ns), self._newest_ns)
        self._newest_ns = int(stamps_ns[-1])
        host, port = int(ipaddress.IPv4Address(self._address[0])), self._address[1]
        ours = batch.hosts == host
        if port:
            ours &= batch.ports == port
        if ours.all():
            return list(map(Datagram, batch.payloads, stamps_ns.tolist()))
        self.foreign += int((~ours).sum())
        return [Datagram(batch.payloads[row], int(stamps_ns[row])) for row in np.flatnonzero(ours)]

    def _open_socket(self) -> socket.socket:
        if self._socket is None:
            raise DeviceError("the transport is not open", where=self.name, hint="Connect the device first")
        return self._socket

    def _failure(self, what: str) -> DeviceError:
        return DeviceError(what, where=self.name, hint="Check address, cable and the network card's settings")


def _singly(wire: socket.socket) -> Batch:
    """The next datagram alone, without a stamp of the kernel; for systems without batches. Raises OSError."""
    try:
        payload, (host, port) = wire.recvfrom(_LARGEST)
    except BlockingIOError:
        payload, host, port = b"", "0.0.0.0", -1
    payloads = [] if port < 0 else [payload]
    rows = len(payloads)
    hosts = np.full(rows, int(ipaddress.IPv4Address(host)), np.uint32)
    return Batch(payloads, np.zeros(rows, np.int64), hosts, np.full(rows, max(port, 0), np.uint16), None)


def _enable(made: socket.socket, option: int) -> bool:
    """Ask the kernel for an extra; False where it does not have it."""
    try:
        made.setsockopt(socket.SOL_SOCKET, option, 1)
    except OSError:
        return False
    return True


def wall_offset_ns(clock: Clock) -> int:
    """How far the wall clock, in which the kernel stamps, is ahead of the session's.

    Between two readings the scheduler may suspend the program for milliseconds: the pair closest together is taken.
    """
    closest_ns, offset_ns = 1 << 62, 0
    for _ in range(5):
        before_ns, wall_ns, after_ns = clock.now_ns(), time.time_ns(), clock.now_ns()
        if after_ns - before_ns < closest_ns:
            closest_ns, offset_ns = after_ns - before_ns, wall_ns - before_ns
        if closest_ns < 5_000:
            break
    return offset_ns
