"""Injects faults into a moving hand: time until demands are zero and joints are still, and the hand's message.

The emulated hand and both its slaves are in this process, on virtual time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from drivers.core.clock import NANOSECONDS, VirtualClock
from drivers.core.errors import DeviceError
from drivers.emulators.ethercat.shadow_chain import emulated_hand
from drivers.ethercat.registers import AlCode, AlState
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.joint_watch import SensorLimits
from drivers.shadow.device.motor_load import LoadLimits
from drivers.shadow.device.motor_watch import SILENT_AFTER_s
from drivers.shadow.ethercat.hand_transport import EthercatSettings, EthercatTransport
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.motors import DRIVEN_JOINTS
from drivers.shadow.protocol.motor_data import FromMotor, MotorFlag
from drivers.shadow.protocol.palm_images import PALMS
from tactile_lab import rigs
from tests.support.memory_port import MemoryPort

CYCLE_s = 0.005
WATCHDOG_s = 0.1
_CALIBRATION = JointCalibration.load(Path(rigs.__file__).parent / "calibrations" / "simulated-hand" / "joints.yaml")
_FFJ3, _CHANNEL = 1, 2  # the motor of FFJ3 and the channel of its sensor
_MOVING_PWM = SensorLimits().frozen_share * HandSettings().gains.of("FFJ3").max_pwm  # less may move nothing
_WARM_UP, _MOVED_rad = 120, 1e-3
_LASTS_s = 3.5


class DrivenHand:
    """A hand with all joints in motion, and with access to all its parts."""

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.far = emulated_hand(self.clock, _CALIBRATION)
        self.faults, self.cable = self.far.palm.palm.faults, self.far.ring.faults
        self.motors = self.far.palm.motors
        settings = EthercatSettings(interface="memory", watchdog_s=WATCHDOG_s)
        self.transport = EthercatTransport("hand", settings, self.clock, MemoryPort(self.far.ring))
        self._send, self.demands, self._eased_ns = self.transport.send, np.zeros(20), 0
        self.transport.send = self._note  # type: ignore[method-assign]
        self.hand = ShadowHand(self.transport, self.clock, _CALIBRATION, HandSettings(cycle_s=CYCLE_s))
        self.hand.connect()
        self._angle, self._direction = 0.0, 1

    def cycle(self) -> None:
        """One cycle of a motion back and forth, slower than the joints could move, so that there is always a demand."""
        self.clock.sleep_until_ns(self.clock.now_ns() + round(CYCLE_s * NANOSECONDS))
        self.far.ring.work()
        self._angle += 0.008 * self._direction
        if not 0.0 <= self._angle <= 1.0:
            self._direction *= -1
        self.hand.set_targets(dict.fromkeys(DRIVEN_JOINTS, self._angle) | {"FFJ3": 0.3 + self._angle})
        self.hand.exchange()

    @property
    def pushed_s(self) -> float:
        """How long FFJ3 has had at least the demand at which it must move, seconds."""
        return (self.clock.now_ns() - self._eased_ns) / NANOSECONDS

    def _note(self, payload: bytes) -> None:
        self.demands = np.array(PALMS["0220"].decode_command(payload).motor_data)
        if abs(self.demands[_FFJ3]) < _MOVING_PWM:
            self._eased_ns = self.clock.now_ns()
        self._send(payload)


@dataclass(frozen=True)
class HandFault:
    """A fault.

    Attributes:
        inject: causes it.
        seen: whether the hand can know of it by now, given the received statuses and the seconds since the fault.
        told: the hand's message then; "" if it goes on.
        lasts_s: its duration, if it ends.
        repair: ends it.
    """

    inject: Callable[[DrivenHand], object]
    told: str
    seen: Callable[[DrivenHand, float], bool] = field(default=lambda hand, since_s: True)
    lasts_s: float = np.inf
    repair: Callable[[DrivenHand], object] = field(default=lambda hand: None)


@dataclass
class FaultOutcome:
    """The outcome of a fault.

    Attributes:
        seen_s: time from the fault until the hand could know of it.
        driven_cycles: cycles with any demand above zero after that.
        still_cycles: cycles after that until the last joint stood still.
        told: the hand's message; "" if there is none.
        goes_on: whether it moved again by itself after the fault.
    """

    seen_s: float = 0.0
    driven_cycles: int = 0
    still_cycles: int = 0
    told: str = ""
    goes_on: bool = False


def _flag(flag: MotorFlag) -> HandFault:
    def raise_flag(hand: DrivenHand) -> None:
        hand.motors.raise_flags(_FFJ3, int(flag))

    def heard(hand: DrivenHand, since_s: float) -> bool:
        return hand.hand.newest is not None and bool(hand.hand.newest.motor.flags[_FFJ3] & flag)

    return HandFault(raise_flag, "FFJ3 (motor 1): stopped: halted", heard)


def _gone(seconds: float, told: str) -> HandFault:
    def plug(hand: DrivenHand) -> None:
        hand.cable.unplugged = False

    return HandFault(lambda hand: setattr(hand.cable, "unplugged", True), told, lasts_s=seconds, repair=plug)


def _silent(motors: range, told: str) -> HandFault:
    return HandFault(
        lambda hand: hand.faults.silent.update(motors), told, lambda hand, since_s: since_s > SILENT_AFTER_s
    )


def _hot(hand: DrivenHand, since_s: float) -> bool:
    return hand.hand.newest is not None and float(hand.hand.newest.motor.values[FromMotor.TEMPERATURE, _FFJ3]) > 55.0


def _pushed(hand: DrivenHand, since_s: float) -> bool:
    return min(since_s, hand.pushed_s) > SensorLimits().frozen_s


def _freeze(hand: DrivenHand) -> None:
    hand.faults.frozen.add(_CHANNEL)


def _reads(count: int, told: str) -> HandFault:
    return HandFault(lambda hand: hand.faults.stuck.update({_CHANNEL: count}), told)


def _pause(hand: DrivenHand) -> None:
    hand.clock.sleep_until_ns(hand.clock.now_ns() + 3 * NANOSECONDS)


def _fall(hand: DrivenHand) -> None:
    hand.far.palm_slave.fall_to(AlState.SAFEOP, AlCode.SYNCHRONISATION)


FAULTS: dict[str, HandFault] = {
    "sensor at 0": _reads(0, "FFJ3 (motor 1): stopped: its sensor reads 0 counts, calibrated are 946 to 2487"),
    "sensor at 4095": _reads(4095, "FFJ3 (motor 1): stopped: its sensor reads 4095 counts"),
    "sensor jumps": _reads(2487, "FFJ3 (motor 1): stopped: its sensor jumps by more than a joint can turn"),
    "sensor frozen": HandFault(_freeze, "while driven", _pushed),
    "one motor silent": _silent(range(1, 2), "FFJ3 (motor 1): stopped: silent for 50 ms. Ten"),
    "ten motors silent": _silent(range(10), "silent for 50 ms, and 4 other motors"),
    "all motors silent": _silent(range(20), "silent for 50 ms, and 9 other motors"),
    "flag: H-bridge": _flag(MotorFlag.BRIDGE_FAULT),
    "flag: stored configuration": _flag(MotorFlag.EEPROM_CRC_BAD),
    "flag: too hot": _flag(MotorFlag.OVER_TEMPERATURE),
    "motor at 57 C": HandFault(lambda hand: hand.motors.heat(_FFJ3, 57.0), "stopped: 57 C, limit 55 C", _hot),
    "tendon overloaded": HandFault(
        lambda hand: hand.faults.torque.update({_FFJ3: 3500}),
        "stopped: torque over 3000 counts",
        lambda hand, since_s: since_s > 2 * LoadLimits().readings * CYCLE_s,
    ),
    "palm hung": HandFault(lambda hand: setattr(hand.far.palm, "hung", True), "stopped: no valid status for 2 s"),
    "palm leaves operation": HandFault(_fall, "left operation"),
    "link gone for 0.5 s": _gone(0.5, ""),
    "link gone for 1.9 s": _gone(1.9, ""),
    "link gone for 10 s": _gone(10.0, "stopped: no valid status for 2 s"),
    "link inside the hand gone": HandFault(
        lambda hand: setattr(hand.cable, "connected", 1), "for 2 s: 1 EtherCAT slaves answer instead of 2"
    ),
    "program stands still for 3 s": HandFault(_pause, "the program stood still for 3.0 s"),
}


def run_fault(fault: HandFault) -> FaultOutcome:
    """Inject a fault into a moving hand, and observe it until the fault is over, or for some seconds."""
    hand, outcome = DrivenHand(), FaultOutcome()
    for _ in range(_WARM_UP):
        hand.cycle()
    assert hand.demands.any(), "it moves"
    begun_ns = hand.clock.now_ns()
    fault.inject(hand)
    cycles, seen, before = 0, False, hand.far.plant.joints_rad
    while (since_s := (hand.clock.now_ns() - begun_ns) / NANOSECONDS) < min(fault.lasts_s, _LASTS_s):
        try:
            hand.cycle()
        except DeviceError as error:
            outcome.told = outcome.told or str(error)
        now = hand.far.plant.joints_rad
        if seen:
            cycles += 1
            outcome.driven_cycles += bool(hand.demands.any())
            outcome.still_cycles = cycles if np.abs(now - before).max() > _MOVED_rad else outcome.still_cycles
        elif outcome.told or fault.seen(hand, since_s + CYCLE_s):
            seen, outcome.seen_s = True, since_s + CYCLE_s
        before = now
    fault.repair(hand)
    outcome.goes_on = _goes_on(hand)
    return outcome


def _goes_on(hand: DrivenHand) -> bool:
    """Whether it moves again by itself within a second."""
    try:
        for _ in range(round(1.0 / CYCLE_s)):
            hand.cycle()
    except DeviceError:
        return False
    return bool(hand.demands.any())
