"""Limits of what the motors do to the hand: the tendons' measured torque, the duty cycle, and pushing without end."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drivers.shadow.motor_data import MAX_PWM, FromMotor
from drivers.shadow.motor_watch import Fault
from drivers.shadow.motors import MotorMap
from drivers.shadow.palm_codec import MOTORS, PalmStatus
from tactile_lab.strict_yaml import StrictModel

_READING_ERROR = 20
"""Counts by which a motor's reported duty cycle may exceed what it may be told."""


def _strong_wrist() -> dict[str, float]:
    return {"WRJ1": 16_000.0, "WRJ2": 16_000.0}


class LoadLimits(StrictModel):
    """How much a motor may do.

    Attributes:
        torque_counts: largest strain-gauge difference of a motor, counts; gauges of 12 bits can not exceed 4095.
        exceptions: the same for single driven joints. The wrist's motors are twenty times as strong as a finger's.
        readings: so many readings in a row over a limit stop the hand; a single one may be a jerk.
        stall_s: pushing for so long with the largest duty cycle stops the hand.
    """

    torque_counts: float = Field(default=3000.0, gt=0.0)
    exceptions: dict[str, float] = Field(default_factory=_strong_wrist)
    readings: int = Field(default=5, ge=1)
    stall_s: float = Field(default=5.0, gt=0.0)


class LoadWatch:
    """Judges the motors' torques and duty cycles.

    Args:
        motors: names of the motors.
        limits: see there.
        largest_pwm: largest duty cycle each motor may be told, shape (20,), counts; MAX_PWM where it keeps a torque.
        where: name of the hand in messages.
    """

    def __init__(self, motors: MotorMap, limits: LoadLimits, largest_pwm: NDArray[np.float64], where: str) -> None:
        self._motors, self._limits, self._where = motors, limits, where
        self._largest_pwm = np.minimum(largest_pwm, MAX_PWM)
        self._torque = np.array([limits.exceptions.get(name, limits.torque_counts) for name in motors.names])
        self.restart()

    def restart(self) -> None:
        """Forget everything seen so far."""
        self._over_torque, self._over_pwm = np.zeros(MOTORS, dtype=int), np.zeros(MOTORS, dtype=int)
        self._pushing_since_ns = np.full(MOTORS, -1, dtype=np.int64)

    def fault(self, status: PalmStatus) -> Fault | None:
        """A reason in this status to stop the hand."""
        motors = status.heard_motors
        if status.motor_data_type == FromMotor.SLOW_MISC:  # its torque word holds a number of the data
            return None
        torque = np.abs(status.torque[motors >> 1].astype(int))
        if (worst := self._counted(self._over_torque, motors, torque > self._torque[motors])) is not None:
            return self._told(worst, f"torque over {self._torque[worst]:.0f} counts")
        if status.motor_data_type != FromMotor.PWM:
            return None
        pwm = np.abs(status.misc[motors >> 1].astype(np.int16).astype(int))
        beyond = pwm > self._largest_pwm[motors] + _READING_ERROR
        if (worst := self._counted(self._over_pwm, motors, beyond)) is not None:
            return self._told(worst, f"duty cycle over its limit of {self._largest_pwm[worst]:.0f} counts")
        return None

    def stall(self, words: NDArray[np.int16], now_ns: int) -> Fault | None:
        """A motor among these demands, shape (20,), that has been pushing for too long; None for none."""
        pushing = np.abs(words.astype(int)) >= np.floor(self._largest_pwm)
        self._pushing_since_ns[~pushing] = -1
        self._pushing_since_ns[pushing & (self._pushing_since_ns < 0)] = now_ns
        lasting = (self._pushing_since_ns >= 0) & (now_ns - self._pushing_since_ns > 1e9 * self._limits.stall_s)
        if not lasting.any():
            return None
        return self._told(int(lasting.argmax()), f"pushed for {self._limits.stall_s:g} s with its largest duty cycle")

    def _counted(self, counts: NDArray[np.int_], motors: NDArray[np.intp], over: NDArray[np.bool_]) -> int | None:
        """Count readings over a limit in a row; the motor that has too many."""
        counts[motors] = np.where(over, counts[motors] + 1, 0)
        return int(counts.argmax()) if counts.max() >= self._limits.readings else None

    def _told(self, motor: int, what: str) -> Fault:
        where = f"{self._where}, {self._motors.names[motor]} (motor {motor})"
        return Fault(f"stopped: {what}", where, "Look at the hand before going on, then resume")
