"""Sockets on which emulators serve."""

from __future__ import annotations

import socket

from drivers.core.errors import DeviceError


def bind_socket(kind: socket.SocketKind, host: str, port: int, where: str) -> socket.socket:
    """Open a socket at an address of this computer.

    Raises:
        DeviceError: the address is not this computer's, or is in use.
    """
    made = socket.socket(socket.AF_INET, kind)
    try:
        if kind == socket.SOCK_STREAM:
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind((host, port))
    except OSError as error:
        made.close()
        what = f"cannot be emulated at {host}:{port} ({error.strerror})"
        raise DeviceError(
            what, where=where, hint="End the other emulated laboratory, or choose a free address"
        ) from error
    return made
