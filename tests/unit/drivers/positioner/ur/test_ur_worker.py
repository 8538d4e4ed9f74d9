"""The stream to the arm, and the device in the session, each over a double of the other side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.core.clock import VirtualClock
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError, DeviceError
from drivers.core.records import RecordKind
from drivers.core.transports import MemoryTransport
from drivers.positioner.codec import PositionerCommand
from drivers.positioner.ur import process
from drivers.positioner.ur.codec import (
    ArmFlags,
    ArmOrder,
    ArmState,
    ArmStatus,
    decode_arm_status,
    encode_arm_command,
)
from drivers.positioner.ur.device import UrPositioner
from drivers.positioner.ur.settings import UrSettings, UrWiring
from drivers.positioner.ur.worker import UrWorker
from drivers.simulation.devices.arm_emulator import ArmEmulator

READY = ArmState(1.0, 7, 2, 1, 1.0, (0.0, 0.0, 0.0), ArmFlags.HEARD | ArmFlags.PROGRAM)
HERE = np.array([0.5, 0.0, 0.4, 0.0, 0.0, 0.0])
THERE = np.array([0.6, 0.0, 0.4, 0.0, 0.0, 0.0])
SETTINGS = UrSettings(payload_kg=4.6, flange_T_forearm=(0.0, 0.0, 0.06, 0.0, 0.0, 0.0))


class FakeArm:
    """Is where it is sent at once."""

    def __init__(self) -> None:
        self.braked, self.now, self.place = False, READY, HERE
        self.done: list[str] = []
        self.deaf = False

    def state(self) -> ArmState:
        return replace(self.now, flags=self.now.flags | self.braked * ArmFlags.BRAKED)

    def q(self) -> Array:
        return self.place

    def servo(self, q: Array) -> None:
        if self.deaf:
            raise DeviceError("does not take commands", where="base")
        self.done.append("servo")
        self.place = q.copy()

    def stand(self) -> None:
        self.done.append("stand")

    def freedrive(self) -> None:
        self.done.append("freedrive")

    def restart(self) -> None:
        self.braked, self.now = False, READY
        self.done.append("restart")


class Statuses:
    def __init__(self) -> None:
        self.read: list[ArmStatus] = []

    def put(self, kind: RecordKind, stamp_ns: int, payload: bytes) -> None:
        self.read.append(decode_arm_status(payload))

    def flush(self) -> None:
        """Nothing waits."""


class Bench:
    def __init__(self) -> None:
        self.clock, self.arm, self.statuses = VirtualClock(), FakeArm(), Statuses()
        self.worker = UrWorker(self.arm, SETTINGS, self.statuses, self.clock)
        self.sequence = 0

    def command(self, q: Array, order: ArmOrder = ArmOrder.FOLLOW) -> None:
        self.sequence += 1
        payload = encode_arm_command(PositionerCommand(self.sequence, q), order)
        assert self.worker.on_orders([{"command": payload.hex()}])

    def cycles(self, count: int) -> None:
        for _ in range(count):
            self.clock.sleep_until_ns(self.clock.now_ns() + 8_000_000)
            self.worker.cycle()


def test_nothing_moves_before_the_first_command() -> None:
    bench = Bench()
    bench.cycles(5)
    assert set(bench.arm.done) == {"stand"}
    assert not bench.arm.braked


def test_targets_are_streamed_within_limits_and_each_command_is_answered() -> None:
    bench = Bench()
    for _ in range(60):
        bench.command(THERE)
        bench.cycles(1)
    np.testing.assert_allclose(bench.arm.place, THERE, atol=1e-4)
    assert [status.sequence for status in bench.statuses.read] == list(range(1, 61))
    steps_m = np.diff([status.q[0] for status in bench.statuses.read])
    assert steps_m.max() <= SETTINGS.speed_m_s * 0.008 * 1.001


def test_a_session_that_hangs_leaves_a_standing_arm() -> None:
    bench = Bench()
    bench.command(np.array([0.8, 0.0, 0.2, 0.0, 0.0, 0.0]))
    bench.cycles(round(SETTINGS.patience_s / 0.008) + 30)
    stood = bench.arm.place.copy()
    bench.cycles(20)
    np.testing.assert_array_equal(bench.arm.place, stood)
    assert stood[0] < 0.75


def test_targets_out_of_reach_are_not_followed() -> None:
    bench = Bench()
    for _ in range(50):
        bench.command(np.array([1.2, 0.0, 0.4, 0.0, 0.0, 0.0]))
        bench.cycles(1)
    np.testing.assert_array_equal(bench.arm.place, HERE)


@pytest.mark.parametrize(
    "state",
    [
        replace(READY, force_N=(80.0, 0.0, 0.0)),
        replace(READY, safety_bits=0b100, flags=ArmFlags.HEARD),
        replace(READY, flags=ArmFlags.HEARD),
        replace(READY, flags=ArmFlags.PROGRAM),
    ],
)
def test_a_stopped_arm_is_streamed_to_again_after_a_restart_alone(state: ArmState) -> None:
    bench = Bench()
    bench.command(THERE)
    bench.cycles(5)
    bench.arm.now = state
    bench.cycles(1)
    bench.arm.now, bench.arm.done = replace(state, force_N=(0.0, 0.0, 0.0)), []
    bench.command(THERE)
    bench.cycles(5)
    assert "servo" not in bench.arm.done
    bench.command(THERE, ArmOrder.RESUME)
    bench.command(THERE)
    bench.cycles(5)
    assert bench.arm.done.count("restart") == 1
    assert "servo" in bench.arm.done


def test_an_arm_that_takes_no_command_is_braked_and_told_of() -> None:
    bench = Bench()
    bench.arm.deaf = True
    bench.command(THERE)
    bench.cycles(3)  # one target may come late
    bench.command(THERE)
    assert ArmFlags.BRAKED not in bench.statuses.read[-1].arm.flags
    bench.cycles(30)
    bench.command(THERE)
    assert ArmFlags.BRAKED in bench.statuses.read[-1].arm.flags


class FreePlant:
    def __init__(self, clock: VirtualClock) -> None:
        self.clock, self.base = clock, HERE

    @property
    def stamp_ns(self) -> int:
        return self.clock.now_ns()

    def move_base(self, target: Array) -> None:
        self.base = target


class Session:
    """A device over the emulated transport."""

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.plant = FreePlant(self.clock)
        self.far = ArmEmulator(self.plant)
        self.device = UrPositioner(MemoryTransport("base", self.far), self.clock, SETTINGS)
        self.device.connect()

    def cycles(self, count: int) -> None:
        for _ in range(count):
            self.clock.sleep_until_ns(self.clock.now_ns() + 10_000_000)
            self.device.exchange()


def test_the_arm_s_own_stop_ends_the_motion_in_its_words_until_it_is_resumed() -> None:
    session = Session()
    session.cycles(3)
    session.far.state = replace(READY, safety_bits=0b100, flags=ArmFlags.HEARD)
    with pytest.raises(DeviceError, match=r"base: protective stop .* release it on the pendant"):
        session.cycles(1)
    assert any("protective stop" in words for words in session.device.health())
    session.far.state = READY
    session.device.resume()
    session.device.set_target(THERE)
    session.cycles(60)
    np.testing.assert_allclose(session.plant.base, THERE)


def test_a_stop_that_lasts_is_told_again_after_a_resume() -> None:
    session = Session()
    session.far.state = replace(READY, flags=ArmFlags.HEARD)
    session.device.resume()
    session.cycles(290)  # the program may take a while to start
    with pytest.raises(DeviceError, match="the program on the arm was stopped"):
        session.cycles(20)


def test_a_person_leads_the_arm_until_it_is_stopped() -> None:
    session = Session()
    session.device.lead_by_hand()
    session.cycles(2)
    assert session.device.arm is not None
    assert ArmFlags.FREE in session.device.arm.flags
    session.plant.base = THERE
    session.cycles(2)
    session.device.stop()
    session.cycles(2)
    assert ArmFlags.FREE not in session.device.arm.flags
    np.testing.assert_array_equal(session.plant.base, THERE)


def test_a_missing_package_is_named_with_the_command_that_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "find_spec", lambda name: None)
    transport = process.UrProcess(UrWiring(wire="ur", host="127.0.0.1"), SETTINGS, "base")
    with pytest.raises(ConfigurationError, match=r"ur-rtde is not installed\. Install it: python3 -m pip .* ur-rtde$"):
        transport.open()
