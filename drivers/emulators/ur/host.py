"""The emulated control box on its TCP ports, fed by the plant.

Lines of JSON on standard input are what a person or the world does: ``{"event": "protective stop"}``; see
:meth:`~drivers.emulators.ur.control_box.ControlBox.befall`.
"""

from __future__ import annotations

import contextlib
import selectors
import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from gtsam import Pose3

from drivers.core.clock import Clock
from drivers.core.errors import CodecError
from drivers.core.orders import END, OrderReader
from drivers.emulators.background import Pace
from drivers.emulators.laboratory.plant_mirror import PlantMirror
from drivers.emulators.laboratory.sockets import bind_socket
from drivers.emulators.ur.control_box import ControlBox
from drivers.emulators.ur.rtde_server import RtdeClient
from drivers.positioner.kinematics import mount_joints, mount_T_forearm
from drivers.positioner.ur.poses import pose_of
from drivers.positioner.ur.settings import UrSettings
from drivers.shadow.device.real_time import request_real_time
from drivers.simulation.hand_plant import CarriedPlant

_DASHBOARD, _PROGRAMS, _RTDE = 29999, (30001, 30002, 30003), 30004
_GREETING = b"Connected: Universal Robots Dashboard Server\n"
_TURN_s = 0.002
_AT_ONCE = 65536
_PRIORITY = 75


class PlantForearm:
    """The plant's forearm in the arm's base frame.

    Args:
        plant: what it moves; its mount stands at the world's origin.
        world_T_arm: where the arm stands.
    """

    def __init__(self, plant: CarriedPlant, world_T_arm: Pose3) -> None:
        self._plant, self._world_T_arm = plant, world_T_arm

    def place(self) -> Pose3:
        """Where the forearm is."""
        return self._world_T_arm.inverse() * mount_T_forearm(self._plant.base)

    def move(self, base_T_forearm: Pose3) -> None:
        """Send it there, the short way round."""
        self._plant.move_base(mount_joints(self._world_T_arm * base_T_forearm, float(self._plant.base[3])))


class Connection:
    """One client of one port: bytes in, bytes out."""

    def __init__(self, wire: socket.socket, take: Callable[[bytes], bytes], rtde: RtdeClient | None = None) -> None:
        self.wire, self.take, self.rtde, self.pace = wire, take, rtde, Pace()


class UrHost:
    """Serves a control box.

    Args:
        box: the box.
        host: address of this computer to serve at.
    """

    def __init__(self, box: ControlBox, host: str) -> None:
        self._box, self._selector = box, selectors.DefaultSelector()
        self._listening = {
            port: bind_socket(socket.SOCK_STREAM, host, port, "base") for port in (_DASHBOARD, *_PROGRAMS, _RTDE)
        }
        self._connections: list[Connection] = []
        for port, wire in self._listening.items():
            wire.listen()
            self._selector.register(wire, selectors.EVENT_READ, port)

    def serve(self) -> None:
        """Serve until standard input ends."""
        orders = OrderReader(sys.stdin.fileno())
        while END not in (heard := orders.waiting()):
            for order in heard:
                self._box.befall(order["event"], order.get("value", 0.0))
            self.turn()
        self.close()

    def turn(self) -> None:
        """Serve what has come within a few milliseconds. A box whose cable is unplugged receives and sends nothing."""
        if self._box.plugged:
            for key, _ in self._selector.select(_TURN_s):
                if isinstance(key.data, Connection):
                    self._serve(key.data)
                else:
                    self._accept(self._listening[key.data], key.data)
            for connection in list(self._connections):
                self._stream(connection)
        else:
            time.sleep(_TURN_s)
        self._box.tick()  # last: a busy machine may have kept this process from commands that came in time

    def close(self) -> None:
        """Hang up and stop listening."""
        for connection in list(self._connections):
            self._hang_up(connection)
        for wire in self._listening.values():
            wire.close()
        self._selector.close()

    def _accept(self, listening: socket.socket, port: int) -> None:
        wire = listening.accept()[0]
        wire.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if port == _RTDE:
            client = RtdeClient(self._box)
            connection = Connection(wire, client.feed, client)
        elif port == _DASHBOARD:
            connection = Connection(wire, self._dashboard)
            wire.sendall(_GREETING)
        else:
            connection = Connection(wire, _Programs(self._box).feed)
        self._connections.append(connection)
        self._selector.register(wire, selectors.EVENT_READ, connection)

    def _dashboard(self, data: bytes) -> bytes:
        lines = data.decode("ascii", errors="replace").splitlines()
        return "".join(self._box.on_dashboard(line) + "\n" for line in lines).encode()

    def _serve(self, connection: Connection) -> None:
        try:
            data = connection.wire.recv(_AT_ONCE)
            if data:
                connection.wire.sendall(connection.take(data))
                return
        except (CodecError, OSError):
            pass
        self._hang_up(connection)

    def _stream(self, connection: Connection) -> None:
        rtde = connection.rtde
        if rtde is None or not rtde.rate_hz:
            return
        if connection.pace.due(rtde.rate_hz):  # an arm never sends what is out of date
            try:
                connection.wire.sendall(rtde.data())
            except OSError:
                self._hang_up(connection)

    def _hang_up(self, connection: Connection) -> None:
        self._connections.remove(connection)
        self._box.on_gone(connection.rtde)
        self._selector.unregister(connection.wire)
        with contextlib.suppress(OSError):
            connection.wire.close()


class _Programs:
    """Puts uploaded programs together: one ends with a line ``end`` that is not indented."""

    def __init__(self, box: ControlBox) -> None:
        self._box, self._text = box, b""

    def feed(self, data: bytes) -> bytes:
        self._text += data
        if self._text.rstrip(b"\0\r\n ").endswith(b"\nend"):
            self._box.on_program(self._text.decode("utf-8", errors="replace"))
            self._text = b""
        return b""


def make(start: dict[str, Any], clock: Clock) -> UrHost:
    """The box at the wiring's ``host``; what it carries is truly what the rig file states.

    A real box is a computer of its own: where permitted it comes before the program that speaks with it.
    """
    request_real_time(_PRIORITY)
    settings = UrSettings.model_validate(start["settings"])
    forearm = PlantForearm(PlantMirror(Path(start["mirror"]), clock), Pose3(np.array(start["world_T_mount"])))
    flange_T_forearm = Pose3() if settings.flange_T_forearm is None else pose_of(settings.flange_T_forearm)
    return UrHost(ControlBox(forearm, clock, flange_T_forearm, settings.payload_kg or 0.0), start["wiring"]["host"])
