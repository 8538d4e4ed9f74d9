"""The real package ur-rtde over TCP to the emulated control box, which a thread of the test serves."""

from __future__ import annotations

import os
import socket
import struct
import threading
from collections.abc import Callable, Iterator
from importlib.util import find_spec

import numpy as np
import pytest
from gtsam import Pose3

from drivers.core.clock import MonotonicClock, VirtualClock
from drivers.core.contacts import Array
from drivers.core.errors import DeviceError
from drivers.emulators.ur.control_box import ControlBox, Series
from drivers.emulators.ur.host import PlantForearm, UrHost
from drivers.emulators.ur.rtde_server import RtdeClient, package
from drivers.positioner.ur.device import UrPositioner
from drivers.positioner.ur.poses import pose_of
from drivers.positioner.ur.process import UrProcess
from drivers.positioner.ur.settings import UrSettings, UrWiring

pytestmark = [
    pytest.mark.skipif(find_spec("rtde_control") is None, reason="the package ur-rtde is not installed"),
    pytest.mark.usefixtures("real_time_alone"),
]

TOOL = (0.0, 0.0, 0.06, 0.0, 0.0, 1.5)
SETTINGS = UrSettings(
    payload_kg=4.6, flange_T_forearm=TOOL, reach_m=(0.2, 1.3), lost_limit=2000, unheard_s=2.0, watchdog_hz=2.0
)
HERE = np.array([0.5, 0.0, 0.36, 0.0, 0.0, 0.0])
THERE = np.array([0.6, 0.1, 0.4, 0.3, 0.0, 0.1])
_LONGEST_TURN_ns = 5_000_000
CYCLES = 6000
"""So many cycles in which something must have happened: a busy machine is slow."""


class FreePlant:
    stamp_ns = 0

    def __init__(self) -> None:
        self.base = HERE

    def move_base(self, target: Array) -> None:
        self.base = target


class Served:
    """A box on its ports, and a device that reaches it through the package."""

    def __init__(self, number: int, series: Series = "e") -> None:
        self.clock, self.plant = MonotonicClock(), FreePlant()
        self.host = f"127.{1 + os.getpid() % 250}.{os.getpid() // 250 % 250}.{number}"
        self._time = VirtualClock()
        self.box = ControlBox(PlantForearm(self.plant, Pose3()), self._time, pose_of(TOOL), 4.6, series)
        self._server, self._ending = UrHost(self.box, self.host), threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()
        self.device = UrPositioner(
            UrProcess(UrWiring(wire="ur", host=self.host), SETTINGS, "base"), self.clock, SETTINGS
        )

    def _serve(self) -> None:
        """The box's time stands still while a busy machine keeps it from serving, or its watchdog would bite."""
        while not self._ending.is_set():
            began_ns = self.clock.now_ns()
            self._server.turn()
            self._time.sleep_until_ns(self._time.now_ns() + min(self.clock.now_ns() - began_ns, _LONGEST_TURN_ns))

    def close(self) -> None:
        self.device.close()
        self._ending.set()
        self._thread.join()
        self._server.close()

    def run_until(self, reached: Callable[[], bool], target: Array | None = None) -> None:
        for _ in range(CYCLES):
            if target is not None:
                self.device.set_target(target)
            self.device.exchange()
            if reached():
                return
            self.clock.sleep_until_ns(self.clock.now_ns() + 10_000_000)
        pytest.fail("it never happened")

    def is_at(self, place: Array) -> Callable[[], bool]:
        return lambda: bool(np.abs(self.plant.base - place).max() < 1e-3)

    def stopped_with(self, words: str) -> None:
        with pytest.raises(DeviceError, match=words):
            self.run_until(lambda: False)


@pytest.fixture
def served() -> Iterator[Served]:
    made = Served(20)
    try:
        yield made
    finally:
        made.close()


@pytest.mark.long  # on a starved machine the box's watchdog bites where it should not
def test_an_arm_is_moved_stopped_resumed_led_and_lost(served: Served) -> None:
    device, box = served.device, served.box
    device.connect()
    assert (box.payload_kg, box.output("runtime_state")) == (4.6, 2)
    np.testing.assert_array_equal(served.plant.base, HERE)
    served.run_until(served.is_at(THERE), THERE)

    stops = (("protective stop", "base: protective stop", HERE), ("stop program", "program on the arm was", THERE))
    for event, words, place in stops:
        box.befall(event)
        served.stopped_with(words)
        box.befall("release")
        device.resume()
        served.run_until(served.is_at(place), place)

    box.befall("push", 80.0)
    served.stopped_with("force 80 N at the tool centre is over the limit of 60 N")
    box.befall("push", 0.0)
    device.resume()
    served.run_until(served.is_at(HERE), HERE)

    device.lead_by_hand()
    served.run_until(lambda: box.free)
    device.stop()
    served.run_until(lambda: not box.free)

    box.befall("unplug")
    served.stopped_with("has stopped answering; it stops by itself")
    assert box.stopped_ns is not None  # by its own watchdog
    box.befall("plug")


def test_an_arm_of_the_cb3_series_is_moved() -> None:
    """It is told from its version, knows no remote control, sends 125 times a second at most, and the first versions
    do not name their model.
    """
    served = Served(21, "cb3")
    served.box.version = (3, 11, 0, 82155)
    try:
        served.device.connect()
        assert (served.box.payload_kg, served.box.output("runtime_state")) == (4.6, 2)
        served.run_until(served.is_at(THERE), THERE)
    finally:
        served.close()


def test_where_the_arm_stands_is_read_with_the_tool_that_was_set(
    monkeypatch: pytest.MonkeyPatch, served: Served
) -> None:
    """A tool set at the pendant stands elsewhere, and on a busy machine what the arm said with it is read late."""
    under_way: dict[RtdeClient, list[bytes]] = {}
    tell = RtdeClient.data

    def tell_late(client: RtdeClient) -> bytes:
        if "actual_TCP_force" not in client.outputs:
            return tell(client)
        waiting = under_way.setdefault(client, [])
        waiting.append(tell(client))
        return waiting.pop(0) if len(waiting) > 150 else waiting[0]

    served.box.payload_kg = 4.6
    monkeypatch.setattr(RtdeClient, "data", tell_late)
    served.device.connect()
    np.testing.assert_allclose(served.device.exchange().q, HERE, atol=1e-6)
    assert "UR10" in served.device.identity
    assert "4.6 kg" in served.device.identity


def test_a_long_tool_of_the_pendant_does_not_put_the_arm_outside_its_workspace(served: Served) -> None:
    served.box._flange_T_tcp = pose_of((0.0, 0.0, 2.0, 0.0, 0.0, 0.0))
    served.device.connect()
    np.testing.assert_allclose(served.device.exchange().q, HERE, atol=1e-6)


def test_an_arm_whose_software_is_not_known_is_refused_before_it_is_taken_over(served: Served) -> None:
    served.box.version = (10, 7, 0, 1)
    with pytest.raises(DeviceError, match=r"PolyScope 10\.7\.0\.1 is not known to this program\. CB3 arms need"):
        served.device.connect()
    assert served.box.output("runtime_state") == 1


def test_an_arm_whose_inputs_another_program_holds_is_refused(served: Served) -> None:
    with socket.create_connection((served.host, 30004)) as other:
        other.sendall(package(ord("V"), b"\x00\x02") + package(ord("I"), b"input_int_register_0"))
        assert other.recv(100)
        with pytest.raises(DeviceError, match="another program holds the arm's RTDE inputs"):
            served.device.connect()
    assert served.box.output("runtime_state") == 1


@pytest.mark.long
@pytest.mark.parametrize(
    ("event", "value", "words"),
    [
        ("local control", 0.0, r"the arm is in local control\. Switch it to remote control"),
        ("power off", 0.0, "the arm's mode is IDLE"),
        ("speed slider", 0.3, "the speed slider is at 30 %"),
        ("protective stop", 0.0, "protective stop"),
        ("start program", 0.0, r"a program is running on the arm\. Stop it"),
        ("carry", 9.0, r"the arm feels 43 N at rest with a payload of 4\.6 kg\. Weigh again"),
    ],
)
def test_an_arm_that_is_not_ready_is_refused_before_it_moves(
    served: Served, event: str, value: float, words: str
) -> None:
    served.box.befall(event, value)
    with pytest.raises(DeviceError, match=words):
        served.device.connect()
    np.testing.assert_array_equal(served.plant.base, HERE)


@pytest.mark.long
def test_a_session_that_is_killed_leaves_a_standing_arm(served: Served) -> None:
    served.device.connect()
    served.run_until(served.is_at(THERE), THERE)
    os.kill(served.device._transport._child.process_id, 9)  # type: ignore[attr-defined]
    while served.box.stopped_ns is None:
        served.clock.sleep_until_ns(served.clock.now_ns() + 10_000_000)
    np.testing.assert_allclose(served.plant.base, THERE, atol=1e-3)


def test_a_client_that_sends_rubbish_is_hung_up_on(served: Served) -> None:
    with socket.create_connection((served.host, 30004)) as client:
        client.sendall(struct.pack(">HB", 3, ord("Z")))
        client.settimeout(30.0)
        assert client.recv(100) == b""
