"""Commands to a child process: lines of JSON through a pipe, without either end waiting for the other."""

from __future__ import annotations

import json
import os
import select
from typing import Any

from drivers.core.errors import DeviceError

Order = dict[str, Any]
END: Order = {"end": True}
"""Returned by the reader when the pipe has closed: the parent has ended."""

_AT_ONCE = 65_536


class OrderReader:
    """The reading end.

    Args:
        descriptor: of the pipe.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor, self._rest = descriptor, b""

    def waiting(self, patience_s: float = 0.0) -> list[Order]:
        """Received commands, oldest first; :data:`END` if no more can arrive."""
        if not select.select([self._descriptor], [], [], patience_s)[0]:
            return []
        data = os.read(self._descriptor, _AT_ONCE)
        *lines, self._rest = (self._rest + data).split(b"\n")
        return [json.loads(line) for line in lines] if data else [END]

    def first(self) -> Order:
        """Wait for the first command; :data:`END` if there is none."""
        while not (orders := self.waiting(1.0)):
            pass
        return orders[0]


class OrdersUnreadError(DeviceError):
    """The process runs, but has not read its commands for long: something holds it up."""


class OrderWriter:
    """The writing end.

    Args:
        descriptor: of the pipe.
        where: the device's name, for messages.
    """

    def __init__(self, descriptor: int, where: str) -> None:
        self._descriptor, self._where = descriptor, where
        os.set_blocking(descriptor, False)

    def give(self, order: Order) -> None:
        """Send a command.

        Raises:
            DeviceError: the process has ended.
            OrdersUnreadError: it has not read commands for long.
        """
        line = json.dumps(order).encode() + b"\n"
        try:
            written = os.write(self._descriptor, line)
        except BrokenPipeError:
            raise DeviceError("its process has ended", where=self._where, hint="Connect again") from None
        except BlockingIOError:
            written = 0
        if written < len(line):
            raise OrdersUnreadError("its process accepts no commands", where=self._where, hint="Connect again")
