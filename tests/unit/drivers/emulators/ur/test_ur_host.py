"""The emulated control box on its ports, turn by turn in one thread."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator

import numpy as np
import pytest
from gtsam import Pose3

from drivers.core.clock import VirtualClock
from drivers.emulators.ur.control_box import ControlBox
from drivers.emulators.ur.host import PlantForearm, UrHost
from drivers.emulators.ur.rtde_server import package

HOST = "127.0.29.1"
"""An address of this computer at which nothing else listens."""

PROGRAM = b'def program():\n  textmsg("RTDE Control Script Loaded")\nend\n'


class Carried:
    """A positioner that is where it is sent."""

    stamp_ns = 0

    def __init__(self) -> None:
        self.base = np.array([0.4, 0.1, 0.3, 6.4, 0.1, 0.0])

    def move_base(self, target: np.ndarray) -> None:
        self.base = target


class Bench:
    def __init__(self) -> None:
        self.carried = Carried()
        forearm = PlantForearm(self.carried, Pose3.Expmap(np.array([0.0, 0.0, 0.3, 0.1, 0.0, 0.0])))
        self.box = ControlBox(forearm, VirtualClock(), Pose3(), 4.6)
        self.host = UrHost(self.box, HOST)
        self.clients: list[socket.socket] = []

    def client(self, port: int) -> socket.socket:
        made = socket.create_connection((HOST, port), 5.0)
        made.settimeout(5.0)
        self.clients.append(made)
        self.host.turn()
        return made

    def ask(self, wire: socket.socket, content: bytes) -> bytes:
        wire.sendall(content)
        self.host.turn()
        return wire.recv(4096)


def waiting(wire: socket.socket) -> bytes:
    """What has arrived by now."""
    wire.setblocking(False)
    try:
        return wire.recv(65536)
    except BlockingIOError:
        return b""
    finally:
        wire.settimeout(5.0)


@pytest.fixture
def bench() -> Iterator[Bench]:
    made = Bench()
    yield made
    for client in made.clients:
        client.close()
    made.host.close()


def test_a_forearm_is_moved_the_short_way_round() -> None:
    carried = Carried()
    forearm = PlantForearm(carried, Pose3.Expmap(np.array([0.0, 0.0, 0.3, 0.1, 0.0, 0.0])))
    place = forearm.place()
    before = carried.base.copy()
    forearm.move(place)
    np.testing.assert_allclose(carried.base, before, atol=1e-9)
    forearm.move(Pose3(place.rotation(), place.translation() + np.array([0.0, 0.0, 0.05])))
    np.testing.assert_allclose(carried.base - before, [0.0, 0.0, 0.05, 0.0, 0.0, 0.0], atol=1e-9)


def test_the_dashboard_greets_and_answers_line_by_line(bench: Bench) -> None:
    dashboard = bench.client(29999)
    assert dashboard.recv(4096) == b"Connected: Universal Robots Dashboard Server\n"
    assert bench.ask(dashboard, b"get robot model\n") == b"UR10\n"
    assert bench.ask(dashboard, b"running\n") == b"Program running: false\n"


def test_a_program_runs_when_its_end_has_arrived(bench: Bench) -> None:
    programs = bench.client(30003)
    programs.sendall(PROGRAM[:20])
    bench.host.turn()
    assert bench.box.output("runtime_state") == 1
    programs.sendall(PROGRAM[20:])
    bench.host.turn()
    assert bench.box.output("runtime_state") == 2


def test_values_stream_after_the_start_and_nothing_passes_an_unplugged_cable(bench: Bench) -> None:
    rtde = bench.client(30004)
    assert bench.ask(rtde, package(ord("V"), b"\x00\x02")) == package(ord("V"), b"\x01")
    outputs = package(ord("O"), struct.pack(">d", 125.0) + b"robot_mode")
    assert bench.ask(rtde, outputs) == package(ord("O"), b"\x01INT32")
    started = bench.ask(rtde, package(ord("S"), b""))
    assert started.startswith(package(ord("S"), b"\x01"))
    bench.box.befall("unplug")
    rtde.sendall(package(ord("P"), b""))
    bench.host.turn()
    assert package(ord("P"), b"\x01") not in waiting(rtde)
    bench.box.befall("plug")
    bench.host.turn()
    assert package(ord("P"), b"\x01") in rtde.recv(4096)


def test_inputs_are_free_again_when_their_client_has_hung_up_or_sent_rubbish(bench: Bench) -> None:
    wanted = package(ord("I"), b"input_int_register_0")
    granted, held = package(ord("I"), b"\x01INT32"), package(ord("I"), b"\x00IN_USE")
    first, second = bench.client(30004), bench.client(30004)
    assert bench.ask(first, wanted) == granted
    assert bench.ask(second, wanted) == held
    first.close()
    bench.host.turn()
    assert bench.ask(second, wanted) == granted
    second.sendall(b"\x00\x01?")
    bench.host.turn()
    assert second.recv(4096) == b""
    assert bench.ask(bench.client(30004), wanted) == granted
