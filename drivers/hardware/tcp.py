"""A TCP connection as a transport: whole messages, each behind its length, for devices whose messages are large."""

from __future__ import annotations

import contextlib
import socket
import struct

from drivers.core.clock import Clock
from drivers.core.errors import CodecError, DeviceError
from drivers.core.transports import Datagram

_LENGTH = struct.Struct("<I")
LONGEST = 64 << 20
"""A longer message is none: something else than the device answers at this port."""

_CONNECT_s, _SEND_s, _AT_ONCE = 2.0, 1.0, 1 << 20


def frame(payload: bytes) -> bytes:
    """A message as it goes over the wire: its length, 32 bits little-endian, and its bytes."""
    return _LENGTH.pack(len(payload)) + payload


class MessageReader:
    """Cuts a stream of bytes into messages."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def feed(self, data: bytes) -> list[bytes]:
        """The messages that are complete now.

        Raises:
            CodecError: a length that no message has.
        """
        self._rest += data
        messages = []
        while len(self._rest) >= _LENGTH.size:
            (length,) = _LENGTH.unpack_from(self._rest)
            if length > LONGEST:
                raise CodecError(f"a message of {length} bytes", hint="Is this the device's port?")
            if len(self._rest) < _LENGTH.size + length:
                break
            messages.append(bytes(self._rest[_LENGTH.size : _LENGTH.size + length]))
            del self._rest[: _LENGTH.size + length]
        return messages


class TcpTransport:
    """Messages to and from one device.

    Args:
        name: the device's name in the rig.
        host, port: where it listens.
        clock: the session's clock.
    """

    def __init__(self, name: str, host: str, port: int, clock: Clock) -> None:
        self.name, self._host, self._port, self._clock = name, host, port, clock
        self._socket: socket.socket | None = None
        self._reader = MessageReader()

    def open(self) -> None:
        """Connect; repeatable. Raises DeviceError when nobody listens."""
        if self._socket is not None:
            return
        try:
            self._socket = socket.create_connection((self._host, self._port), _CONNECT_s)
        except OSError as error:
            what = f"cannot connect to {self._host}:{self._port} ({error.strerror or error})"
            raise self._failure(what) from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._reader = MessageReader()

    def close(self) -> None:
        """Disconnect; idempotent."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def send(self, payload: bytes) -> None:
        """Send one message. Raises DeviceError when the device is gone or takes nothing."""
        wire = self._open()
        wire.settimeout(_SEND_s)
        try:
            wire.sendall(frame(payload))
        except OSError as error:
            raise self._lost_error(error.strerror or str(error)) from error

    def receive(self) -> list[Datagram]:
        """All messages that are complete, never blocking. Raises DeviceError when the device is gone."""
        wire, messages = self._open(), list[bytes]()
        wire.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            while data := self._read(wire):
                messages += self._cut(data)
            if not messages:
                raise self._lost_error("the device closed the connection")
        now_ns = self._clock.now_ns()
        return [Datagram(message, now_ns) for message in messages]

    def _read(self, wire: socket.socket) -> bytes:
        try:
            return wire.recv(_AT_ONCE)
        except BlockingIOError:
            raise
        except OSError as error:
            raise self._lost_error(error.strerror or str(error)) from error

    def _cut(self, data: bytes) -> list[bytes]:
        try:
            return self._reader.feed(data)
        except CodecError as error:
            raise self._failure(f"{self._host}:{self._port} speaks another protocol: {error.what}") from error

    def _open(self) -> socket.socket:
        if self._socket is None:
            raise DeviceError("the transport is not open", where=self.name, hint="Connect the device first")
        return self._socket

    def _lost_error(self, why: str) -> DeviceError:
        return self._failure(f"lost the connection to {self._host}:{self._port} ({why})")

    def _failure(self, what: str) -> DeviceError:
        return DeviceError(
            what, where=self.name, hint="Check that the device's program runs, its address and its cable"
        )
