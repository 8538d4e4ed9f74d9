"""Sends and receives EtherCAT frames through a raw socket of a network interface."""

from __future__ import annotations

import errno
import select
import socket
from typing import Protocol

from drivers.core.errors import DeviceError
from drivers.ethercat.frames import ETHERTYPE

LARGEST_FRAME = 1600
"""Size of the largest Ethernet frame, bytes."""

_NEEDS_RIGHT = (
    "Grant it once with: sudo setcap cap_net_raw+ep PATH, for the python that runs this program, or run it as root"
)


class Port(Protocol):
    """Sends and receives whole Ethernet frames. ``name`` is the interface's."""

    name: str

    @property
    def hardware_address(self) -> bytes:
        """Six bytes; zeros if there is no hardware."""

    def open(self) -> None:
        """Open the port; repeatable; after a failure nothing stays open. Raises DeviceError."""

    def close(self) -> None:
        """Release everything; idempotent."""

    def send(self, frame: bytes) -> None:
        """Send one frame. Raises DeviceError if the interface is gone."""

    def receive(self, timeout_s: float) -> bytes | None:
        """The next frame, waiting at most this long; None if none arrives. Raises DeviceError as ``send``."""


class RawPort:
    """A network interface through a raw packet socket. Needs Linux and the permission to use raw sockets.

    The socket never blocks: waiting has its own time limit, so that a lost frame does not cost more than that.
    """

    def __init__(self, interface: str) -> None:
        self.name = interface
        self._socket: socket.socket | None = None
        self._hardware_address = bytes(6)

    @property
    def hardware_address(self) -> bytes:
        return self._hardware_address

    def open(self) -> None:
        if self._socket is not None:
            return
        self._check_name()
        raw = self._raw_socket()
        try:
            raw.setblocking(False)
            raw.bind((self.name, ETHERTYPE))
            self._hardware_address = bytes(raw.getsockname()[4])
        except OSError as error:
            raw.close()
            raise self._failure(error) from error
        self._socket = raw

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def send(self, frame: bytes) -> None:
        try:
            self._open().send(frame)
        except BlockingIOError:
            return  # the interface's queue is full: the frame is lost, as on a bad cable, and the receiver counts it
        except OSError as error:
            raise self._failure(error) from error

    def receive(self, timeout_s: float) -> bytes | None:
        raw = self._open()
        try:
            if not select.select([raw], [], [], max(timeout_s, 0.0))[0]:  # poll() would round up to milliseconds
                return None
            return self._next(raw)
        except BlockingIOError:
            return None
        except OSError as error:
            raise self._failure(error) from error

    def _next(self, raw: socket.socket) -> bytes:
        """The waiting frame. Raises OSError."""
        return raw.recv(LARGEST_FRAME)

    def _open(self) -> socket.socket:
        if self._socket is None:
            raise DeviceError("the interface is not open", where=self.name, hint="Connect the device first")
        return self._socket

    def _check_name(self) -> None:
        present = [name for _, name in socket.if_nameindex()]
        if self.name not in present:
            raise DeviceError(
                "no such network interface", where=self.name, hint=f"Available interfaces: {', '.join(present)}"
            )

    def _raw_socket(self) -> socket.socket:
        try:
            return socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERTYPE))
        except PermissionError as error:
            raise DeviceError("no permission for raw sockets", where=self.name, hint=_NEEDS_RIGHT) from error
        except (AttributeError, OSError) as error:
            raise DeviceError(f"raw sockets are not available ({error})", where=self.name, hint="Use Linux") from error

    def _failure(self, error: OSError) -> DeviceError:
        if error.errno in (errno.ENETDOWN, errno.ENXIO, errno.ENODEV):
            hint = f"Plug the cable in and set it up: sudo ip link set {self.name} up"
            return DeviceError("the network interface is down or gone", where=self.name, hint=hint)
        return DeviceError(f"the network interface failed ({error})", where=self.name, hint="Check the adapter")
