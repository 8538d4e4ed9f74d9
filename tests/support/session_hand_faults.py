"""Faults of the hand itself in the middle of a session: its sensors, motors and link, from the emulated palm's side.

A session of one grasp on the simulated rig, in virtual time. While the fingers close a fault begins; what the session
sends from then on is watched, and so are the true joints.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import numpy as np

from drivers.core.clock import NANOSECONDS
from drivers.core.errors import TactileLabError
from drivers.core.transports import Datagram, Transport
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.joint_watch import SensorLimits
from drivers.shadow.protocol.motor_data import MotorFlag
from drivers.shadow.protocol.palm_images import PALMS
from drivers.simulation.devices.motor_bank import MotorBank
from drivers.simulation.devices.palm_emulator import PalmEmulator
from drivers.simulation.world import SimulatedWorld
from sessions.conductor.session_outcome import Ending
from tactile_lab.rigs import laboratory
from tactile_lab.workflow.running import SessionRequest, run_session
from tests.support.at_phase import At
from tests.support.session_sweep import STRIKES_AT

CYCLE_s = 0.01
"""Of the session, and of the hand in it."""

_FFJ3, _CHANNEL = 1, 2  # the motor of FFJ3 and the channel of its sensor
_TURNED_rad = 2e-4  # in a cycle: 0.02 rad/s
_MUST_MOVE = SensorLimits().frozen_share * HandSettings().gains.of("FFJ3").max_pwm  # demand of FFJ3, counts


class WatchedHand:
    """The hand's transport, the palm at its far end, and what passed between them since the fault.

    Attributes:
        palm, motors: the far end.
        fault: begins with :meth:`begin`.
        driven_ns: when a demand above zero was last sent.
        eased_ns: when FFJ3 last had a smaller demand than the one at which it has to move.
        turned_ns: when a joint last turned.
        sent: commands since the fault.
    """

    def __init__(self, transport: Transport, world: SimulatedWorld, fault: SessionHandFault) -> None:
        self.name, self._transport, self._world, self.fault = transport.name, transport, world, fault
        palm, motors = world._peers["hand"], world._devices[0]
        assert isinstance(palm, PalmEmulator)
        assert isinstance(motors, MotorBank)
        self.palm, self.motors = palm, motors
        self.begun_ns: int | None = None
        self.driven_ns = self.turned_ns = self.eased_ns = self.sent = 0
        self._before = world.plant.joints_rad

    def open(self) -> None:
        self._transport.open()

    def close(self) -> None:
        self._transport.close()

    def begin(self) -> None:
        """Begin the fault."""
        self.begun_ns = self._world.clock.now_ns()
        self.fault.inject(self)

    @property
    def since_s(self) -> float:
        """Since the fault; negative before."""
        return -1.0 if self.begun_ns is None else (self._world.clock.now_ns() - self.begun_ns) / NANOSECONDS

    @property
    def is_gone(self) -> bool:
        """Whether the link is gone."""
        return 0.0 <= self.since_s < self.fault.gone_s

    def send(self, payload: bytes) -> None:
        now_ns = self._world.clock.now_ns()
        if self.begun_ns is not None:
            self.sent += 1
            demands = PALMS["0220"].decode_command(payload).motor_data
            if any(demands):
                self.driven_ns = now_ns
                if abs(demands[_FFJ3]) < _MUST_MOVE:
                    self.eased_ns = now_ns
            now = self._world.plant.joints_rad
            if np.abs(now - self._before).max() > _TURNED_rad:
                self.turned_ns = now_ns
            self._before = now
        if not self.is_gone:
            self._transport.send(payload)

    def receive(self) -> list[Datagram]:
        arrived = self._transport.receive()
        return [] if self.is_gone else arrived


@dataclass(frozen=True)
class SessionHandFault:
    """A fault.

    Attributes:
        inject: causes it.
        rule_s: time that its rule gives it until it can be seen (docs/failures.md), with the time until it is heard.
        told: part of the session's reason; "" if the session goes on.
        gone_s: how long the link is gone.
        while_driven: it can be seen only while FFJ3 is driven: its rule's time counts from then.
    """

    inject: Callable[[WatchedHand], object]
    rule_s: float
    told: str
    gone_s: float = 0.0
    while_driven: bool = False


def _reads(count: int, told: str) -> SessionHandFault:
    return SessionHandFault(lambda hand: hand.palm.faults.stuck.update({_CHANNEL: count}), CYCLE_s, told)


def _jump(hand: WatchedHand) -> None:
    """To the farther end of its calibrated counts."""
    low, high = 946, 2487
    hand.palm.faults.stuck[_CHANNEL] = high if hand.palm._shown[_CHANNEL] < (low + high) / 2 else low


def _silent(motors: range) -> SessionHandFault:
    return SessionHandFault(lambda hand: hand.palm.faults.silent.update(motors), 0.05 + CYCLE_s, "silent for")


def _flag(flag: MotorFlag) -> SessionHandFault:
    def raise_flag(hand: WatchedHand) -> None:
        hand.motors.raise_flags(_FFJ3, int(flag))

    return SessionHandFault(raise_flag, 8 * CYCLE_s, "halted")


def _gone(seconds: float, told: str = "") -> SessionHandFault:
    return SessionHandFault(lambda hand: None, 2 * CYCLE_s, told, seconds)


FAULTS: dict[str, SessionHandFault] = {
    "sensor at 0": _reads(0, "its sensor reads 0 counts"),
    "sensor at 4095": _reads(4095, "its sensor reads 4095 counts"),
    "sensor jumps": SessionHandFault(_jump, CYCLE_s, "jumps by more than a joint can turn"),
    "sensor frozen": SessionHandFault(
        lambda hand: hand.palm.faults.frozen.add(_CHANNEL),
        SensorLimits().frozen_s + CYCLE_s,
        "while driven",
        while_driven=True,
    ),
    "one motor silent": _silent(range(1, 2)),
    "ten motors silent": _silent(range(10)),
    "all motors silent": _silent(range(20)),
    "flag: H-bridge": _flag(MotorFlag.BRIDGE_FAULT),
    "flag: stored configuration": _flag(MotorFlag.EEPROM_CRC_BAD),
    "flag: too hot": _flag(MotorFlag.OVER_TEMPERATURE),
    "motor at 57 C": SessionHandFault(
        lambda hand: hand.motors.heat(_FFJ3, 57.0), 1.0 + 8 * CYCLE_s, "57 C, limit 55 C"
    ),
    "tendon overloaded": SessionHandFault(
        lambda hand: hand.palm.faults.torque.update({_FFJ3: 3500}), 10 * CYCLE_s, "torque over"
    ),
    "link gone for 0.5 s": _gone(0.5),
    "link gone for 1.9 s": _gone(1.9),
    "link gone for 10 s": _gone(10.0, "no valid status"),
}


@dataclass(frozen=True)
class SessionHandOutcome:
    """The outcome of a fault in a session.

    Attributes:
        driven_s: from the fault (or from when FFJ3 was driven with it) until the last demand above zero; None unless
            the fault ended the session.
        turned_s: from the fault until the last joint stood still; None unless the fault ended the session.
        ended: why the session ended; "" if it was completed.
    """

    driven_s: float | None
    turned_s: float | None
    ended: str


def run_fault(fault: SessionHandFault, root: Path) -> SessionHandOutcome:
    """Run a session with a fault.

    Raises:
        AssertionError: the fault did not begin.
    """
    watched: list[WatchedHand] = []
    build = laboratory.simulated_world

    def world_with_fault(*arguments: object) -> SimulatedWorld:
        world = build(*arguments)  # type: ignore[arg-type]
        given = world.transports()
        watched.append(WatchedHand(given["hand"], world, fault))
        world.transports = lambda: {**given, "hand": watched[-1]}  # type: ignore[method-assign]
        return world

    with patch.object(laboratory, "simulated_world", world_with_fault):
        try:
            closing = At(STRIKES_AT, lambda: watched[-1].begin())
            outcome = run_session(SessionRequest("sim", "box-10x6x4", root, seed=1, grasps=1), closing).outcome
            ended = "" if outcome.ending is Ending.COMPLETE else outcome.reason
        except TactileLabError as stopped:
            ended = str(stopped)
    hand = watched[-1]
    assert hand.begun_ns is not None, "the fault never began"
    if not fault.told or fault.told not in ended:
        return SessionHandOutcome(None, None, ended)
    begun_ns = max(hand.begun_ns, hand.eased_ns) if fault.while_driven else hand.begun_ns
    after = [max(0, stamp_ns - begun_ns) / NANOSECONDS for stamp_ns in (hand.driven_ns, hand.turned_ns)]
    return SessionHandOutcome(after[0], after[1], ended)
