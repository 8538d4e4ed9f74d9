"""An emulated control box, command by command: what it puts out after each, and what it says to the dashboard."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from gtsam import Pose3, Rot3

from drivers.core.clock import VirtualClock
from drivers.emulators.ur.control_box import EVENTS, ControlBox, Series
from drivers.emulators.ur.rtde_server import RtdeClient, package, type_of
from tests.support.baseline import assert_baseline
from tests.support.carried_forearm import PROGRAM, Forearm
from tests.support.plain_values import plain

OUTPUTS = (
    "timestamp", "actual_TCP_pose", "actual_TCP_force", "payload", "speed_scaling", "target_speed_fraction",
    "robot_status_bits", "robot_mode", "safety_status_bits", "runtime_state", "output_int_register_0",
    "output_double_register_3",
)  # fmt: skip


@pytest.mark.parametrize("series", ["e", "cb3"])
def test_a_box_through_every_command_and_event(series: Series) -> None:
    clock, forearm = VirtualClock(), Forearm()
    box = ControlBox(forearm, clock, Pose3(Rot3.Yaw(1.5), np.array([0.0, 0.0, 0.06])), 4.6, series)
    told = {}

    def note(what: str) -> None:
        clock.sleep_until_ns(clock.now_ns() + 20_000_000)
        box.tick()
        values = [box.output(name) for name in OUTPUTS]
        told[f"{len(told)} {what}"] = plain([values, forearm.pose, box.free, box.stopped_ns, box.plugged, box.remote])

    note("switched on")
    box.on_program("def other():\nend\n")
    note("another program")
    box.on_program(PROGRAM)
    note("program")
    numbers = (0.4, -0.1, 0.3, 0.1, 0.2, -0.3)
    for command in (29, 17, 40, 24, 16, 52, 53, 35, 99, 255):
        values = (12.0,) if command == 35 else (4.5,) if command == 17 else numbers
        box.on_inputs({"input_int_register_0": 0})
        doubles = {f"input_double_register_{index}": value for index, value in enumerate(values)}
        box.on_inputs({"input_int_register_0": command} | doubles)
        note(f"command {command}")
    for event in EVENTS:
        box.befall("release")
        box.remote = True
        box.on_program(PROGRAM)
        box.on_inputs({"input_int_register_0": 52})
        box.befall(event, 0.5)
        note(event)
    for line in (
        "polyscopeVersion", "is in remote control", "get robot model", "get serial number", "running", "stop",
        "popup hello there", "dance",
    ):  # fmt: skip
        told[f"dashboard {line}"] = box.on_dashboard(f"{line}\n")
    assert_baseline(f"ur/box_{series}", told, rtol=1e-9, atol=1e-12)


def test_the_bytes_of_every_package() -> None:
    box = ControlBox(Forearm(), VirtualClock(), Pose3(), 4.6)
    client, other = RtdeClient(box), RtdeClient(box)
    names = ",".join(OUTPUTS).encode()
    asked = {
        "version": package(ord("V"), b"\x00\x02"),
        "old version": package(ord("V"), b"\x00\x01"),
        "controller": package(ord("v"), b""),
        "outputs": package(ord("O"), struct.pack(">d", 250.0) + names),
        "inputs": package(ord("I"), b"input_int_register_0,input_double_register_3,input_bit_register_64"),
        "unknown": package(ord("I"), b"nothing_at_all"),
        "start": package(ord("S"), b""),
        "data": package(ord("U"), b"\x01" + struct.pack(">id?", 24, 0.5, True)),
    }
    answers = {what: client.feed(sent) for what, sent in asked.items()}
    answers["another's"] = other.feed(asked["inputs"])
    rates = [client.rate_hz, other.rate_hz]
    answers["pause"] = client.feed(package(ord("P"), b""))
    types = {name: type_of(name) for name in (*OUTPUTS, "safety_mode", "payload_cog", "async_operation_progress", "x")}
    found = {"answers": plain(answers), "rates": [*rates, client.rate_hz], "sent": client.data().hex(), "types": types}
    assert_baseline("ur/packages", found)
