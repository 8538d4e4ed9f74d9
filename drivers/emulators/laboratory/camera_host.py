"""The emulated camera under the table on a TCP socket; it sees the plant and serves one client at a time."""

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
from drivers.hardware.tcp import MessageReader, frame
from drivers.simulation.calibration import SimulatedCalibration
from drivers.simulation.devices.camera_emulator import CameraEmulator
from drivers.simulation.settings import SimulationSettings
from drivers.simulation.world import SimulatedWorld

_AT_ONCE = 65536


class CameraHost:
    """Takes a picture whenever its client asks."""

    def __init__(self, emulator: CameraEmulator, wire: socket.socket) -> None:
        self._emulator, self._wire = emulator, wire
        self._client: socket.socket | None = None
        self._reader = MessageReader()
        wire.listen(1)

    def serve(self) -> None:
        """Serve until standard input ends."""
        while sys.stdin not in (ready := select.select([sys.stdin, self._wire, *self._clients()], [], [])[0]):
            if self._wire in ready:
                self._hang_up()
                self._client = self._wire.accept()[0]
            elif ready and not self._serve_client():
                self._hang_up()
        self._hang_up()
        self._wire.close()

    def _serve_client(self) -> bool:
        """Process what the client has sent; returns whether it is still connected."""
        client = self._client
        assert client is not None
        with contextlib.suppress(CodecError, ConnectionError):
            if not (data := client.recv(_AT_ONCE)):
                return False
            for payload in self._reader.feed(data):
                self._emulator.write(payload)
            for picture in self._emulator.read():
                client.sendall(frame(picture.payload))
            return True
        return False

    def _clients(self) -> list[socket.socket]:
        return [] if self._client is None else [self._client]

    def _hang_up(self) -> None:
        if self._client is not None:
            self._client.close()
        self._client, self._reader = None, MessageReader()


def make(start: dict[str, Any], clock: Clock) -> CameraHost:
    """The camera at ``host`` and ``port``, in a simulated rig with these settings and this seed."""
    settings = SimulationSettings.model_validate(start["simulation"])
    tips = SimulatedCalibration.of_hand(settings.fingertips, Path(start["tips"]), Path(start["motors"]))
    world = SimulatedWorld(settings, start["seed"], tips)
    emulator = world.build_camera(PlantMirror(Path(start["mirror"]), clock))
    return CameraHost(emulator, bind_socket(socket.SOCK_STREAM, start["host"], start["port"], "camera"))
