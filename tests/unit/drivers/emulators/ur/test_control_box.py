"""The emulated control box, spoken to in bytes as its manual has them, without the package that it is for."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from gtsam import Pose3, Rot3

from drivers.core.clock import VirtualClock
from drivers.core.errors import CodecError
from drivers.emulators.ur.control_box import ControlBox, Series
from drivers.emulators.ur.rtde_server import RtdeClient, package
from drivers.positioner.ur.poses import tcp_of
from tests.support.carried_forearm import PROGRAM, Forearm

FLANGE_T_FOREARM = Pose3(Rot3.Yaw(1.5), np.array([0.0, 0.0, 0.06]))


class Bench:
    def __init__(self) -> None:
        self.clock, self.forearm = VirtualClock(), Forearm()
        self.box = ControlBox(self.forearm, self.clock, FLANGE_T_FOREARM, 4.6)
        self.client = RtdeClient(self.box)

    def command(self, number: int, *values: float) -> None:
        doubles = {f"input_double_register_{index}": value for index, value in enumerate(values)}
        self.box.on_inputs({"input_int_register_0": 0})
        self.box.on_inputs({"input_int_register_0": number} | doubles)

    def wait(self, seconds: float) -> None:
        self.clock.sleep_until_ns(self.clock.now_ns() + round(seconds * 1e9))
        self.box.tick()


@pytest.fixture
def bench() -> Bench:
    made = Bench()
    made.box.on_program(PROGRAM)
    return made


def test_a_client_is_led_from_the_version_to_data_packages() -> None:
    bench = Bench()
    asked = package(ord("V"), b"\x00\x02") + package(ord("v"), b"")
    asked += package(ord("O"), struct.pack(">d", 125.0) + b"timestamp,robot_mode,nothing")
    asked += package(ord("I"), b"input_int_register_0,input_double_register_3") + package(ord("S"), b"")
    answers = bench.client.feed(asked[:20]) + bench.client.feed(asked[20:])
    assert answers == (
        package(ord("V"), b"\x01")
        + package(ord("v"), struct.pack(">4I", 5, 12, 0, 1101319))
        + package(ord("O"), b"\x01DOUBLE,INT32,NOT_FOUND")
        + package(ord("I"), b"\x01INT32,DOUBLE")
        + package(ord("S"), b"\x01")
    )
    assert bench.client.rate_hz == 125.0
    assert bench.client.data() == package(ord("U"), b"\x01" + struct.pack(">di", 0.0, 7))


def test_inputs_belong_to_one_client_at_a_time() -> None:
    bench = Bench()
    other = RtdeClient(bench.box)
    ask = package(ord("I"), b"input_int_register_0")
    assert bench.client.feed(ask) == package(ord("I"), b"\x01INT32")
    assert other.feed(ask) == package(ord("I"), b"\x00IN_USE")
    bench.box.on_gone(bench.client)
    assert other.feed(ask) == package(ord("I"), b"\x01INT32")


@pytest.mark.parametrize("damaged", [package(ord("Z"), b""), b"\x00\x01U"])
def test_what_is_no_package_is_refused(damaged: bytes) -> None:
    with pytest.raises(CodecError):
        Bench().client.feed(damaged)


def test_a_target_of_the_tool_centre_moves_the_forearm_there(bench: Bench) -> None:
    bench.command(29, *tcp_of(FLANGE_T_FOREARM))
    there = Pose3(Rot3.Yaw(-0.4), np.array([0.6, -0.2, 0.3]))
    bench.command(24, *tcp_of(there))
    assert bench.forearm.pose.equals(there, 1e-9)
    np.testing.assert_allclose(bench.box.output("actual_TCP_pose"), tcp_of(there), atol=1e-9)


def test_an_arm_without_its_tool_centre_tells_where_its_flange_is() -> None:
    bench = Bench()
    flange = bench.forearm.pose * FLANGE_T_FOREARM.inverse()
    np.testing.assert_allclose(bench.box.output("actual_TCP_pose"), tcp_of(flange), atol=1e-9)


def test_a_wrong_payload_is_felt(bench: Bench) -> None:
    bench.command(17, 3.6, 0.0, 0.0, 0.1)
    assert bench.box.output("payload") == 3.6
    assert np.array(bench.box.output("actual_TCP_force"))[2] == pytest.approx(-9.81)


def test_the_watchdog_ends_a_program_that_nobody_feeds(bench: Bench) -> None:
    bench.command(35, 10.0)
    bench.wait(0.09)
    bench.box.on_inputs({"input_int_register_0": 0})
    bench.wait(0.09)
    assert bench.box.output("runtime_state") == 2
    bench.wait(0.02)
    assert bench.box.output("runtime_state") == 1
    before = bench.forearm.pose
    bench.command(24, *tcp_of(Pose3()))
    assert bench.forearm.pose is before


def test_a_program_that_a_person_starts_is_not_watched_by_the_last_one(bench: Bench) -> None:
    bench.command(35, 10.0)
    bench.box.befall("stop program")
    bench.box.befall("start program")
    bench.wait(1.0)
    assert bench.box.output("runtime_state") == 2


@pytest.mark.parametrize(
    ("event", "value", "output", "told"),
    [
        ("protective stop", 0.0, "safety_status_bits", 0b100),
        ("emergency stop", 0.0, "safety_status_bits", 0b10000000),
        ("power off", 0.0, "robot_mode", 5),
        ("stop program", 0.0, "runtime_state", 1),
        ("speed slider", 0.3, "target_speed_fraction", 0.3),
    ],
)
def test_what_befalls_an_arm_is_told(bench: Bench, event: str, value: float, output: str, told: float) -> None:
    bench.box.befall(event, value)
    assert bench.box.output(output) == told


def test_a_program_runs_on_a_ready_arm_in_remote_control_alone() -> None:
    for event in ("protective stop", "power off", "local control"):
        bench = Bench()
        bench.box.befall(event)
        bench.box.on_program(PROGRAM)
        assert bench.box.output("runtime_state") != 2
    bench.box.on_program("def other():\nend\n")
    assert bench.box.output("runtime_state") == 1


def test_a_cb3_does_not_know_remote_control() -> None:
    box = ControlBox(Forearm(), VirtualClock(), Pose3(), 4.6, "cb3")
    assert "could not understand" in box.on_dashboard("is in remote control\n")
    assert box.on_dashboard("PolyscopeVersion\n").startswith("URSoftware 3.15")


@pytest.mark.parametrize(("series", "asked_Hz", "sent_Hz"), [("cb3", 500.0, 125.0), ("e", 500.0, 500.0)])
def test_a_box_sends_no_faster_than_its_series(series: Series, asked_Hz: float, sent_Hz: float) -> None:
    client = RtdeClient(ControlBox(Forearm(), VirtualClock(), Pose3(), 4.6, series))
    client.feed(package(ord("O"), struct.pack(">d", asked_Hz) + b"actual_TCP_pose") + package(ord("S"), b""))
    assert client.rate_hz == sent_Hz
