"""Requests to the motors cycle by cycle, and the state known from their answers.

The palm reads half of the motors in a cycle, the even or the odd ones, and the requested data type changes on the step
to the odd ones: (even, T1), (odd, T2), (even, T2), (odd, T3) and so on, as Shadow's host does (protocols: Motor
polling). Types that change slowly take a turn of two cycles when their period is over, so that both halves answer
them; types that never change are requested in every second turn after connecting, until all are known.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from drivers.core.clock import NANOSECONDS
from drivers.core.configuration import StrictModel, load_model
from drivers.core.contacts import Array
from drivers.shadow.protocol.motor_data import FromMotor, SlowData, as_signed, celsius, volts
from drivers.shadow.protocol.palm_codec import MOTORS, PalmStatus

_EVERY_TURN, _AT_FIRST = -1.0, -2.0

_KINDS: dict[str, FromMotor] = {
    "flags": FromMotor.FLAGS,
    "pwm": FromMotor.PWM,
    "current": FromMotor.CURRENT,
    "sgl": FromMotor.GAUGE_LEFT,
    "sgr": FromMotor.GAUGE_RIGHT,
    "temperature": FromMotor.TEMPERATURE,
    "voltage": FromMotor.VOLTAGE,
    "can_num_received": FromMotor.CAN_RECEIVED,
    "can_num_transmitted": FromMotor.CAN_TRANSMITTED,
    "slow_data": FromMotor.SLOW_MISC,
    "can_error_counters": FromMotor.CAN_ERRORS,
    "pterm": FromMotor.P_TERM,
    "iterm": FromMotor.I_TERM,
    "dterm": FromMotor.D_TERM,
}


class PollingRates(StrictModel):
    """How often each type is requested from the motors, in the words of Shadow's ``motor_data_polling.yaml``.

    Each is -1 for every turn, -2 for after connecting only, a period in seconds, or left out for never. Flags have to
    be asked in every turn or at least once a second, as the hand's safety rests on them, and temperatures at least
    every five seconds.
    """

    flags: float = _EVERY_TURN
    pwm: float | None = _EVERY_TURN
    current: float | None = _EVERY_TURN
    sgl: float | None = None
    sgr: float | None = None
    temperature: float = Field(default=1.0, le=5.0)
    voltage: float | None = 2.0
    can_num_received: float | None = None
    can_num_transmitted: float | None = None
    slow_data: float | None = None
    can_error_counters: float | None = None
    pterm: float | None = None
    iterm: float | None = None
    dterm: float | None = None

    @model_validator(mode="after")
    def _meaningful(self) -> PollingRates:
        for name, rate in self.model_dump(exclude_none=True).items():
            if rate <= 0.0 and rate not in (_EVERY_TURN, _AT_FIRST):
                raise ValueError(f"{name}: a rate must be -1, -2 or a period above 0 s")
        if self.flags == _AT_FIRST or self.flags > 1.0 or self.temperature == _AT_FIRST:
            raise ValueError("flags and temperature must be requested periodically")
        return self

    @property
    def always(self) -> tuple[FromMotor, ...]:
        """Types that rotate all the time."""
        return self._with(_EVERY_TURN)

    @property
    def at_first(self) -> tuple[FromMotor, ...]:
        """Turns after connecting; the slow data come one after the other in as many turns as there are."""
        once = self._with(_AT_FIRST)
        slow = (FromMotor.SLOW_MISC,) * (len(SlowData) - 1 if FromMotor.SLOW_MISC in once else 0)
        return tuple(kind for kind in once if kind is not FromMotor.SLOW_MISC) + slow

    @property
    def periods_s(self) -> dict[FromMotor, float]:
        """Intervals of the types that are requested periodically, seconds."""
        rates = ((kind, getattr(self, name)) for name, kind in _KINDS.items())
        return {kind: rate for kind, rate in rates if rate is not None and rate > 0.0}

    def _with(self, rate: float) -> tuple[FromMotor, ...]:
        return tuple(kind for name, kind in _KINDS.items() if getattr(self, name) == rate)


class _RatesFile(StrictModel):
    motor_data_update_rate: PollingRates


def load_rates(path: Path) -> PollingRates:
    """Read a hand's ``motor_data_polling.yaml``.

    Raises:
        ConfigurationError: the file cannot be used.
    """
    return load_model(path, _RatesFile).motor_data_update_rate


class MotorPolling:
    """Which type is requested from which motors in each cycle.

    Args:
        rates: how often for each type.
    """

    def __init__(self, rates: PollingRates | None = None) -> None:
        rates = rates or PollingRates()
        self._always, self._periods_s = rates.always or (FromMotor.FLAGS,), rates.periods_s
        self._at_first = deque(rates.at_first)
        self._first_is_next = False
        self._odd = True
        self._turn = 0
        self._kind = self._always[0]
        self._due_ns: dict[FromMotor, int] = {}

    def next(self, now_ns: int) -> tuple[int, FromMotor]:
        """The parity (0 even, 1 odd motors) and the type of this cycle's request."""
        self._odd = not self._odd
        if self._odd:
            self._kind = self._next_kind(now_ns)
        return int(self._odd), self._kind

    def _next_kind(self, now_ns: int) -> FromMotor:
        for kind, period_s in self._periods_s.items():
            if now_ns >= self._due_ns.get(kind, now_ns):
                self._due_ns[kind] = now_ns + round(period_s * NANOSECONDS)
                return kind
        self._first_is_next = not self._first_is_next
        if self._at_first and self._first_is_next:
            return self._at_first.popleft()
        self._turn += 1
        return self._always[self._turn % len(self._always)]


@dataclass(frozen=True, eq=False)
class MotorReadings:
    """What is known of the motors; every array by motor number, NaN where a motor was never heard.

    Attributes:
        torque: strain-gauge difference, counts, shape (20,); comes with every answer.
        torque_stamps_ns: when each arrived, shape (20,), session clock; -1 for never.
        values: latest value of each type, shape (16, 20), rows by
        :class:`~drivers.shadow.protocol.motor_data.FromMotor`.
        stamps_ns: when each arrived, shape (16, 20); -1 for never.
        slow: what never changes, shape (17, 20), rows by :class:`~drivers.shadow.protocol.motor_data.SlowData`.
    """

    torque: Array
    torque_stamps_ns: NDArray[np.int64]
    values: Array
    stamps_ns: NDArray[np.int64]
    slow: Array

    @property
    def pwm(self) -> Array:
        """Duty cycle the motors report, counts of 1023."""
        return np.asarray(self.values[FromMotor.PWM])

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
        """Flag words (:class:`~drivers.shadow.protocol.motor_data.MotorFlag`); 0 where a motor was never heard."""
        return np.asarray(np.nan_to_num(self.values[FromMotor.FLAGS]), dtype=np.int64)


_UNITS: dict[int, Callable[[NDArray[np.uint16]], Array | NDArray[np.integer]]] = {
    FromMotor.PWM: as_signed,
    FromMotor.CURRENT: as_signed,
    FromMotor.VOLTAGE: volts,
    FromMotor.TEMPERATURE: celsius,
}
"""How the value of a type is read; of the others as it stands."""

_NUMBERED = (FromMotor.SLOW_MISC, FromMotor.CONFIG_READBACK)
"""Types whose torque word is a number of the data."""

_KIND_COUNT = len(FromMotor)


class MotorMemory:
    """Gathers the alternating answers into the latest known state of all motors."""

    def __init__(self) -> None:
        self._torque = np.full(MOTORS, np.nan)
        self._torque_stamps_ns = np.full(MOTORS, -1, dtype=np.int64)
        self._values = np.full((len(FromMotor), MOTORS), np.nan)
        self._stamps_ns = np.full((len(FromMotor), MOTORS), -1, dtype=np.int64)
        self._slow = np.full((len(SlowData), MOTORS), np.nan)

    def update(self, status: PalmStatus, stamp_ns: int) -> None:
        """Take the answers of one status; motors that stayed silent or answered another type keep their values."""
        kind = status.motor_data_type
        if not FromMotor.INVALID < kind < _KIND_COUNT:
            return
        motors, packets = status.heard_places
        torque, misc = status.torque[packets], status.misc[packets]
        self._values[kind][motors] = _UNITS[kind](misc) if kind in _UNITS else misc
        self._stamps_ns[kind][motors] = stamp_ns
        if kind not in _NUMBERED:
            self._torque[motors] = torque
            self._torque_stamps_ns[motors] = stamp_ns
        elif kind == FromMotor.SLOW_MISC:
            known = (torque > 0) & (torque < len(SlowData))
            self._slow = self._slow.copy()  # readings that were given away keep theirs
            self._slow[torque[known], status.heard_motors[known]] = misc[known]

    def readings(self) -> MotorReadings:
        """A copy of what is known."""
        return MotorReadings(
            self._torque.copy(),
            self._torque_stamps_ns.copy(),
            self._values.copy(),
            self._stamps_ns.copy(),
            self._slow,
        )
