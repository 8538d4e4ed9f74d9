"""Limits of what the motors do to the hand: the tendons' measured torque, the duty cycle, and pushing without end.

It looks at every cycle: over ten or twenty motors, plain lists take a quarter of the time of arrays.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drivers.core.clock import NANOSECONDS
from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.shadow.device.motor_watch import Fault
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol.motor_data import MAX_PWM, FromMotor, as_signed
from drivers.shadow.protocol.palm_codec import MOTORS, PalmStatus

_READING_ERROR = 20
"""Counts by which a motor's reported duty cycle may exceed what it may be told."""


def _strong_wrist() -> dict[str, float]:
    return {"WRJ1": 16_000.0, "WRJ2": 16_000.0}


class LoadLimits(StrictModel):
    """How much a motor may do.

    Attributes:
        torque_counts: largest strain-gauge difference of a motor, counts; gauges of 12 bits cannot exceed 4095.
        exceptions: the same for single driven joints. The wrist's motors are twenty times as strong as a finger's.
        readings: the hand stops after this many readings in a row over a limit; a single one may be a jerk.
        stall_s: pushing for so long with the largest duty cycle stops the hand, unless the joint turns meanwhile.
        stall_rad: a joint that has turned so far does turn.
    """

    torque_counts: float = Field(default=3000.0, gt=0.0)
    exceptions: dict[str, float] = Field(default_factory=_strong_wrist)
    readings: int = Field(default=5, ge=1)
    stall_s: float = Field(default=1.0, gt=0.0)
    stall_rad: float = Field(default=0.05, gt=0.0)


class LoadWatch:
    """Judges the motors' torques and duty cycles.

    Args:
        motors: names of the motors.
        limits: see there.
        largest_pwm: largest allowed duty cycle of each motor, shape (20,), counts; MAX_PWM where it keeps a torque.
        where: name of the hand in messages.
    """

    def __init__(self, motors: MotorMap, limits: LoadLimits, largest_pwm: NDArray[np.float64], where: str) -> None:
        self._motors, self._limits, self._where = motors, limits, where
        self._largest_pwm: list[float] = np.minimum(largest_pwm, MAX_PWM).tolist()
        self._stalling = [max(math.floor(largest), 1) for largest in self._largest_pwm]  # without demand none stalls
        self._torque = [limits.exceptions.get(name, limits.torque_counts) for name in motors.names]
        self._stall_ns = limits.stall_s * NANOSECONDS
        self.restart()

    def restart(self) -> None:
        """Forget everything seen so far."""
        self._over_torque, self._over_pwm = [0] * MOTORS, [0] * MOTORS
        self._pushing_since: list[tuple[int, float] | None] = [None] * MOTORS

    def fault(self, status: PalmStatus) -> Fault | None:
        """A reason in this status to stop the hand."""
        if status.motor_data_type == FromMotor.SLOW_MISC:  # its torque word holds a number of the data
            return None
        heard = status.heard_motors
        packets, motors = heard >> 1, heard.tolist()
        if (worst := self._over(self._over_torque, motors, status.torque[packets], self._torque)) is not None:
            return self._fault(worst, f"torque over {self._torque[worst]:.0f} counts")
        if status.motor_data_type != FromMotor.PWM:
            return None
        duty = as_signed(status.misc[packets])
        if (worst := self._over(self._over_pwm, motors, duty, self._largest_pwm, _READING_ERROR)) is not None:
            return self._fault(worst, f"duty cycle over its limit of {self._largest_pwm[worst]:.0f} counts")
        return None

    def stall(self, words: NDArray[np.int16], joints_rad: Array, now_ns: int) -> Fault | None:
        """A motor among these demands, shape (20,), that has pushed for too long and turned nothing; None for none.

        Args:
            words: demands by motor number.
            joints_rad: measured joint angles, shape (24,), radians.
            now_ns: present time.
        """
        pushing = [abs(word) >= largest for word, largest in zip(words.tolist(), self._stalling, strict=True)]
        if not any(pushing):
            self._pushing_since = [None] * MOTORS
            return None
        angles_rad = self._motors.from_joints.dot(joints_rad).tolist()
        for motor, (pushes, angle_rad) in enumerate(zip(pushing, angles_rad, strict=True)):
            since = self._pushing_since[motor] if pushes else None
            if pushes and (since is None or abs(angle_rad - since[1]) > self._limits.stall_rad):
                since = now_ns, angle_rad
            self._pushing_since[motor] = since
            if since is not None and now_ns - since[0] > self._stall_ns:
                return self._fault(motor, f"stalled for {self._limits.stall_s:g} s at its largest duty cycle")
        return None

    def _over(
        self, counts: list[int], motors: list[int], readings: NDArray[np.int16], limits: list[float], error: int = 0
    ) -> int | None:
        """Count readings over a limit in a row; the motor that has too many."""
        for motor, reading in zip(motors, readings.tolist(), strict=True):
            counts[motor] = counts[motor] + 1 if abs(reading) > limits[motor] + error else 0
        most = max(counts)
        return counts.index(most) if most >= self._limits.readings else None

    def _fault(self, motor: int, what: str) -> Fault:
        where = f"{self._where}, {self._motors.names[motor]} (motor {motor})"
        return Fault(f"stopped: {what}", where, "Check the hand, then resume")
