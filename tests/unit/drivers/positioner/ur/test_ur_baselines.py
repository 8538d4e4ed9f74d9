"""What an arm's program asks of the package ur-rtde, call by call, and what it tells people, state by state."""

from __future__ import annotations

import socket
import sys
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drivers.core.clock import VirtualClock
from drivers.core.errors import DeviceError
from drivers.positioner.ur.checks import (
    PLAYING,
    ROBOT_MODES,
    before_motion,
    before_program,
    not_ready,
    safety_stop,
    stop_cause,
    wrong_version,
)
from drivers.positioner.ur.codec import ArmFlags, ArmState
from drivers.positioner.ur.limiter import MotionLimiter
from drivers.positioner.ur.rtde_arm import RtdeArm
from drivers.positioner.ur.settings import UrSettings
from tests.support.baseline import assert_baseline
from tests.support.plain_values import plain

FLANGE_T_FOREARM = (0.0, 0.01, 0.06, 0.1, -0.2, 0.3)
SETTINGS = UrSettings(payload_kg=4.6, centre_of_gravity_m=(0.0, 0.02, 0.1), flange_T_forearm=FLANGE_T_FOREARM)
READY = ArmState(1.0, 7, PLAYING, 1, 1.0, (0.0, 0.0, 0.0), ArmFlags.HEARD | ArmFlags.PROGRAM)


class Package:
    """Stands for the package and the arm: what it is asked is told, what it answers can be changed."""

    def __init__(self, clock: VirtualClock) -> None:
        self.told: list[Any] = []
        self.says: dict[str, Any] = {
            "polyscopeVersion": "URSoftware 5.12.0.1101319 (Jun 1)",
            "isInRemoteControl": True,
            "getRobotModel": "UR10",
            "getPayload": 4.6,
            "getTCPOffset": list(FLANGE_T_FOREARM),
            "getTimestamp": lambda: clock.now_ns() / 1e9,
            "getRuntimeState": 1,
            "getRobotMode": 7,
            "getSafetyStatusBits": 1,
            "getTargetSpeedFraction": 1.0,
            "getActualTCPForce": [1.0, -2.0, 3.0, 0.0, 0.0, 0.0],
            "getActualTCPPose": [0.5, 0.1, 0.4, 1.2094, 1.6401, 1.1143],
            "isProgramRunning": True,
        }

    def part(self, name: str) -> Callable[..., Any]:
        """A class of the package; those of its methods that only ask are answered, the others are noted."""

        def made(*arguments: object) -> Any:
            self.told.append([name, *arguments])
            return _Part(self)

        return made


class _Part:
    def __init__(self, package: Package) -> None:
        self._package = package

    def __getattr__(self, name: str) -> Any:
        def called(*arguments: object) -> Any:
            asks = name.startswith(("get", "is", "polyscope")) and not arguments
            if not asks:
                self._package.told.append([name, *arguments])
            answer = self._package.says.get(name, True)
            if isinstance(answer, Exception):
                raise answer
            return answer() if callable(answer) else answer

        return called


class Bench:
    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.clock = VirtualClock()
        self.package = Package(self.clock)
        parts = {
            "rtde_control": "RTDEControlInterface",
            "rtde_receive": "RTDEReceiveInterface",
            "dashboard_client": "DashboardClient",
        }
        for module, part in parts.items():
            monkeypatch.setitem(sys.modules, module, SimpleNamespace(**{part: self.package.part(part)}))
        monkeypatch.setattr(socket, "create_connection", self._knocked)
        self.arm = RtdeArm("10.0.0.2", SETTINGS, self.clock, "base")

    def _knocked(self, address: tuple[str, int], timeout: float) -> Any:
        self.package.told.append(["knock", *address, timeout])
        return SimpleNamespace(close=lambda: None)

    def wait(self, seconds: float) -> None:
        self.clock.sleep_until_ns(self.clock.now_ns() + round(seconds * 1e9))

    def connect(self) -> str:
        found = self.arm.connect()
        self.package.says["getRuntimeState"] = PLAYING
        return found

    def refusal(self, act: Callable[[], object]) -> str:
        with pytest.raises(DeviceError) as refused:
            act()
        return f"{refused.value.where}: {refused.value.what} / {refused.value.hint}"


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(monkeypatch)


def test_every_call_of_a_session_with_an_arm(bench: Bench) -> None:
    arm, told = bench.arm, bench.package.told
    identity = bench.connect()
    told.append(["connected", identity, bench.clock.now_ns(), plain(arm.state()), arm.q()])
    arm.servo(np.array([0.5, 0.12, 0.41, 0.2, 0.1, -0.1]))
    arm.stand()
    arm.stand()
    arm.freedrive()
    arm.freedrive()
    told.append(["led", plain(arm.state())])
    arm.servo(np.array([0.5, 0.12, 0.41, 0.2, 0.1, -0.1]))
    frozen = bench.clock.now_ns() / 1e9
    arm.state()
    bench.package.says["getTimestamp"] = frozen
    arm.state()
    for silent_s in (0.04, 0.02, 0.13, 0.02):
        bench.wait(silent_s)
        told.append(["silent", silent_s, plain(arm.state().flags)])
        arm.servo(np.full(6, 0.3))
        arm.stand()
        arm.freedrive()
    bench.package.says["getTimestamp"] = lambda: bench.clock.now_ns() / 1e9
    bench.package.says["getRuntimeState"] = 1
    bench.wait(0.1)
    arm.state()
    arm.braked = True
    told.append(["braked", plain(arm.state())])
    arm.restart()
    told.append(["restarted", bench.clock.now_ns(), plain(arm.state())])
    bench.package.says["getRuntimeState"] = PLAYING
    arm.restart()
    arm.close()
    arm.close()
    assert_baseline("ur/calls", {str(number): call for number, call in enumerate(plain(told))})


REFUSED: list[dict[str, Any]] = [
    {"polyscopeVersion": "URSoftware 5.5.1.0"},
    {"isInRemoteControl": False},
    {"getRobotModel": RuntimeError("timeout")},
    {"getRuntimeState": PLAYING},
    {"getRobotMode": 5},
    {"getTCPOffset": [0.0, 0.01, 0.0603, 0.1, -0.2, 0.3]},
    {"getPayload": 4.62},
    {"setPayload": False},
    {"setTcp": RuntimeError("gone")},
    {"getActualTCPPose": [0.5, 0.1, 1.4, 0.0, 0.0, 0.0]},
    {"getActualTCPForce": [0.0, 0.0, 20.4, 0.0, 0.0, 0.0]},
]


def test_why_an_arm_is_not_taken_over(monkeypatch: pytest.MonkeyPatch) -> None:
    found = {}
    for changed in REFUSED:
        bench = Bench(monkeypatch)
        bench.package.says |= changed
        words = bench.refusal(bench.arm.connect)
        found["-".join(changed)] = [words, [call[0] for call in bench.package.told][-3:], bench.clock.now_ns()]
    assert_baseline("ur/refusals", found)


def test_ports_without_an_answer_and_inputs_of_another_program_are_named(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def held(*arguments: object) -> None:
        raise RuntimeError("One of the RTDE input registers are already in use!\n  Currently")

    def broken(*arguments: object) -> None:
        raise RuntimeError("no\n  route")

    def deaf(address: tuple[str, int], timeout: float) -> None:
        raise OSError(111, "Connection refused")

    said = []
    for part in (held, broken):
        monkeypatch.setitem(sys.modules, "rtde_control", SimpleNamespace(RTDEControlInterface=part))
        said.append(bench.refusal(bench.arm.connect))
    monkeypatch.setattr(socket, "create_connection", deaf)
    said.append(bench.refusal(bench.arm.connect))
    assert said == [
        "base: another program holds the arm's RTDE inputs / End it; on the pendant disable EtherNet/IP, PROFINET and "
        "MODBUS, then try again",
        "base: cannot be taken over (no route) / Look at the pendant, then try again",
        "base: no answer at 10.0.0.2, port 29999 (dashboard): Connection refused / Check the arm's power, its cable "
        "and wires.base.host",
    ]


def test_what_each_state_of_an_arm_means() -> None:
    here = np.array([0.5, 0.1, 0.4, 0.0, 0.0, 0.0])
    places = {
        "near": [0.1, 0.17, 0.4, 0, 0, 0],
        "far": [0.6, 0.5, 0.4, 0, 0, 0],
        "low": [0.5, 0, -0.31, 0, 0, 0],
        "tilted": [0.5, 0, 0.4, 0, 1.91, 0],
    }
    forces = {str(force): replace(READY, force_N=(0.0, 0.6 * force, 0.8 * force)) for force in (20.0, 20.6, 60.0, 60.6)}
    flags = {str(bits): replace(READY, flags=ArmFlags(bits)) for bits in range(16)}
    unstated = {key: SETTINGS.model_copy(update={key: None}) for key in ("payload_kg", "flange_T_forearm")}
    found = {
        "modes": {str(mode): not_ready(replace(READY, robot_mode=mode), SETTINGS) for mode in (*ROBOT_MODES, 11)},
        "safety": {hex(1 << bit): safety_stop(replace(READY, safety_bits=1 << bit)) for bit in range(13)},
        "slider": {
            str(share): not_ready(replace(READY, speed_fraction=share), SETTINGS)
            for share in (0.99, 0.9949, 0.9951, 1.0)
        },
        "places": {name: before_motion(READY, np.array(q, float), SETTINGS) for name, q in places.items()},
        "rest": {name: before_motion(arm, here, SETTINGS) for name, arm in forces.items()},
        "stop": {name: stop_cause(arm, SETTINGS) for name, arm in (forces | flags).items()},
        "program": {key: before_program(replace(READY, runtime_state=1), stated) for key, stated in unstated.items()},
        "taken": [before_program(replace(READY, runtime_state=state), SETTINGS) for state in (1, 2)],
        "versions": {v: wrong_version(v) for v in ("3.10.1", "3.11", "4.99.0", "5.5.9", "5.6.0", "6.0", "10.7")},
    }
    assert_baseline("ur/states", found)


def test_a_way_with_its_speeds() -> None:
    limiter = MotionLimiter((0.3, 1.2), (2.0, 6.0), np.zeros(6))
    target = np.array([0.03, -0.02, 0.01, 0.2, 0.0, -0.1])
    way = [limiter.step(target, 0.02).copy() for _ in range(14)]
    speeds = limiter.speed.copy()
    stopped = [limiter.step(-target, 0.02), limiter.brake(0.02), limiter.brake(0.02)]
    assert_baseline("ur/way", {"way": way, "speeds": speeds, "stopped": stopped}, rtol=1e-9, atol=1e-12)
