"""The emulated positioner on a UDP socket, driven by the plant."""

from __future__ import annotations

import contextlib
import select
import socket
import sys
from pathlib import Path
from typing import Any

from drivers.core.clock import Clock
from drivers.core.errors import CodecError
from drivers.emulators.laboratory.plant_mirror import PlantMirror
from drivers.emulators.laboratory.sockets import bind_socket
from drivers.simulation.devices.positioner_emulator import PositionerEmulator


class PositionerHost:
    """Answers each command immediately."""

    def __init__(self, emulator: PositionerEmulator, wire: socket.socket) -> None:
        self._emulator, self._wire = emulator, wire

    def serve(self) -> None:
        """Serve until standard input ends."""
        while sys.stdin not in (ready := select.select([sys.stdin, self._wire], [], [])[0]):
            if ready:
                self._answer()
        self._wire.close()

    def _answer(self) -> None:
        with contextlib.suppress(CodecError, ConnectionError):  # like a real device, ignore whether anybody listens
            payload, client = self._wire.recvfrom(1000)
            self._emulator.write(payload)
            for status in self._emulator.read():
                self._wire.sendto(status.payload, client)


def make(start: dict[str, Any], clock: Clock) -> PositionerHost:
    """The positioner at the wiring's ``host`` and ``port``."""
    mirror, place = PlantMirror(Path(start["mirror"]), clock), start["wiring"]
    return PositionerHost(
        PositionerEmulator(mirror), bind_socket(socket.SOCK_DGRAM, place["host"], place["port"], "base")
    )
