"""What the motors are asked cycle by cycle, and what is known of them from their answers.

The palm hears half of the motors in a cycle, the even or the odd ones, and the requested data type changes on the step
to the odd ones: (even, T1), (odd, T2), (even, T2), (odd, T3) and so on, as Shadow's host does. Types that change
slowly take a turn of two cycles when their period is over, so that both halves answer them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.shadow.motor_data import FromMotor, celsius, signed, volts
from drivers.shadow.palm_codec import MOTORS, PalmStatus
from tactile_lab.clock import NANOSECONDS
from tactile_lab.geometry.contacts import Array

ALWAYS: tuple[FromMotor, ...] = (FromMotor.FLAGS, FromMotor.PWM, FromMotor.CURRENT)
"""Types that rotate all the time."""

PERIODS_s: Mapping[FromMotor, float] = {FromMotor.TEMPERATURE: 1.0, FromMotor.VOLTAGE: 2.0}
"""Types that are asked at intervals, seconds: Shadow's own intervals."""


class MotorPolling:
    """Which motors are asked for which type in each cycle."""

    def __init__(self) -> None:
        self._odd = True
        self._turn = 0
        self._kind = ALWAYS[0]
        self._due_ns: dict[FromMotor, int] = {}

    def next(self, now_ns: int) -> tuple[int, FromMotor]:
        """The parity (0 even, 1 odd motors) and the type of this cycle's request."""
        self._odd = not self._odd
        if self._odd:
            self._kind = self._next_kind(now_ns)
        return int(self._odd), self._kind

    def _next_kind(self, now_ns: int) -> FromMotor:
        for kind, period_s in PERIODS_s.items():
            if now_ns >= self._due_ns.get(kind, now_ns):
                self._due_ns[kind] = now_ns + round(period_s * NANOSECONDS)
                return kind
        self._turn += 1
        return ALWAYS[self._turn % len(ALWAYS)]


@dataclass(frozen=True, eq=False)
class MotorReadings:
    """What is known of the motors; every array by motor number, NaN where a motor was never heard.

    Attributes:
        torque: strain-gauge difference, counts, shape (20,); comes with every answer.
        torque_stamps_ns: when each was heard, shape (20,), session clock; -1 for never.
        values: latest value of each type, shape (16, 20), rows by :class:`~drivers.shadow.motor_data.FromMotor`.
        stamps_ns: when each was heard, shape (16, 20); -1 for never.
    """

    torque: Array
    torque_stamps_ns: NDArray[np.int64]
    values: Array
    stamps_ns: NDArray[np.int64]

    @property
    def pwm(self) -> Array:
        """Duty cycle the motors report, counts of 1023."""
        return np.asarray(self.values[FromMotor.PWM])

    @property
    def current_mA(self) -> Array:
        """Motor current, milliamperes."""
        return np.asarray(self.values[FromMotor.CURRENT])

    @property
    def voltage_V(self) -> Array:
        """Supply voltage, volts."""
        return np.asarray(self.values[FromMotor.VOLTAGE])

    @property
    def temperature_C(self) -> Array:
        """Temperature near the motor, degrees Celsius."""
        return np.asarray(self.values[FromMotor.TEMPERATURE])

    @property
    def flags(self) -> NDArray[np.int64]:
        """Flag words (:class:`~drivers.shadow.motor_data.MotorFlag`); 0 where a motor was never heard."""
        return np.asarray(np.nan_to_num(self.values[FromMotor.FLAGS]), dtype=np.int64)

    def age_s(self, kind: FromMotor, now_ns: int) -> Array:
        """Age of each motor's value of one type, seconds; infinite where it was never heard."""
        stamps_ns = self.stamps_ns[kind]
        return np.where(stamps_ns < 0, np.inf, (now_ns - stamps_ns) / NANOSECONDS)


class MotorMemory:
    """Gathers the alternating answers into the latest known state of all motors."""

    def __init__(self) -> None:
        self._torque = np.full(MOTORS, np.nan)
        self._torque_stamps_ns = np.full(MOTORS, -1, dtype=np.int64)
        self._values = np.full((len(FromMotor), MOTORS), np.nan)
        self._stamps_ns = np.full((len(FromMotor), MOTORS), -1, dtype=np.int64)

    def update(self, status: PalmStatus, stamp_ns: int) -> None:
        """Take the answers of one status; motors that stayed silent or answered another type keep their values."""
        kind = status.motor_data_type
        if not FromMotor.INVALID < kind < len(FromMotor):
            return
        motors = status.heard_motors
        packets = motors >> 1
        self._values[kind, motors] = _in_units(FromMotor(kind), status.misc[packets])
        self._stamps_ns[kind, motors] = stamp_ns
        if kind not in (FromMotor.SLOW_MISC, FromMotor.CONFIG_READBACK):  # their torque word is a type number
            self._torque[motors] = status.torque[packets]
            self._torque_stamps_ns[motors] = stamp_ns

    def readings(self) -> MotorReadings:
        """A copy of what is known."""
        return MotorReadings(
            self._torque.copy(), self._torque_stamps_ns.copy(), self._values.copy(), self._stamps_ns.copy()
        )


def _in_units(kind: FromMotor, misc: NDArray[np.uint16]) -> Array | NDArray[np.integer]:
    if kind in (FromMotor.PWM, FromMotor.CURRENT):
        return signed(misc)
    if kind is FromMotor.VOLTAGE:
        return volts(misc)
    return celsius(misc) if kind is FromMotor.TEMPERATURE else misc
