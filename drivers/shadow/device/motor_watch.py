"""What the motors' own reports mean for the hand: reasons to stop it, and remarks for people."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drivers.core.clock import NANOSECONDS
from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.errors import DeviceError
from drivers.shadow.device.hand_samples import HandSample
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol.motor_data import (
    SERIOUS_FLAGS,
    FromMotor,
    MOTOR_PATIENCE_s,
    MotorFlag,
    celsius,
    describe_flags,
)
from drivers.shadow.protocol.palm_codec import PalmStatus

SILENT_AFTER_s = 0.05
"""A motor not heard for this long may not be driven; each is asked every second cycle."""

_MISSED = 2  # questions in a row left unanswered at least, where cycles are long
_TOLD_SILENT_s = 0.5  # some answers hold no torque, which is what a sample remembers

_NO_TORQUE = int(MotorFlag.GAUGE_LEFT_FAULT | MotorFlag.GAUGE_RIGHT_FAULT | MotorFlag.MOTOR_ID_INVALID)
"""Flags with which a motor cannot keep a torque."""

SPARE_TIME_us = 50
"""A healthy palm has at least this much spare time in its cycle."""


class HeatLimits(StrictModel):
    """Temperatures measured near the motors, degrees Celsius. The motors halt themselves at 60.

    Attributes:
        warm_C: from here on the motor's duty cycle is limited to ``warm_share`` of its largest.
        hot_C: from here on the hand stops.
        warm_share: see ``warm_C``.
    """

    warm_C: float = 50.0
    hot_C: float = Field(default=55.0, le=60.0)
    warm_share: float = Field(default=0.5, gt=0.0, le=1.0)


@dataclass(frozen=True)
class Fault:
    """Why the hand has stopped itself: what, where, and what to do next."""

    what: str
    where: str
    hint: str

    def error(self) -> DeviceError:
        """The fault as an error to raise."""
        return DeviceError(self.what, where=self.where, hint=self.hint)


class MotorWatch:
    """Judges the motors' answers: flags, temperatures, and whether they come at all.

    Args:
        motors: names of the motors.
        heat: temperature limits.
        where: name of the hand in messages.
        keep_torque: torques are commanded, which some flags forbid.
    """

    def __init__(self, motors: MotorMap, heat: HeatLimits, where: str, *, keep_torque: bool = False) -> None:
        self._motors, self._heat, self._where = motors, heat, where
        self._serious = SERIOUS_FLAGS | (_NO_TORQUE if keep_torque else 0)
        self.restart()

    def restart(self) -> None:
        """Forget which motors have answered."""
        self._status_ns: int | None = None
        self._heard_ns = np.zeros(len(self._motors.names), dtype=np.int64)
        self._missed = np.zeros(len(self._motors.names), dtype=np.int64)

    def hear(self, status: PalmStatus, now_ns: int) -> None:
        """Take note of who answered; after a gap in the statuses everyone has time again."""
        if self._status_ns is None or now_ns - self._status_ns > MOTOR_PATIENCE_s * NANOSECONDS:
            self._heard_ns.fill(now_ns)
            self._missed.fill(0)
        self._status_ns = now_ns
        self._missed[status.which_motors & 1 :: 2] += 1
        answered, _ = status.heard_places
        self._heard_ns[answered], self._missed[answered] = now_ns, 0

    def silence(self, driven: NDArray[np.bool_], now_ns: int) -> Fault | None:
        """A motor among the driven ones, shape (20,), that has not answered for too long."""
        late = driven & (self._missed >= _MISSED)
        if not late.any() or not (late := late & (now_ns - self._heard_ns > SILENT_AFTER_s * NANOSECONDS)).any():
            return None
        motors = np.flatnonzero(late).tolist()
        others = f", and {len(motors) - 1} other motors" if len(motors) > 1 else ""
        what = f"stopped: silent for {1000 * SILENT_AFTER_s:.0f} ms{others}"
        hint = "Ten of one bus, or all: look at the hand's power; one: its board or connector"
        return Fault(what, self._name(motors[0]), hint)

    def fault(self, status: PalmStatus, *, settling: bool) -> Fault | None:
        """A reason in this status to stop the hand.

        Args:
            status: flags or temperatures of half of the motors; other types hold no reason.
            settling: demands have only just begun to flow, so that motors may report that they had halted.
        """
        motors = status.heard_motors
        if status.motor_data_type == FromMotor.FLAGS:
            return self._flag_fault(motors, status.misc[motors >> 1], settling)
        if status.motor_data_type == FromMotor.TEMPERATURE:
            return self._heat_fault(motors, celsius(status.misc[motors >> 1]))
        return None

    def pwm_share(self, temperature_C: Array) -> Array:
        """Share of the largest duty cycle each motor may use, shape (20,); unheard motors (NaN) all of it."""
        return np.where(temperature_C >= self._heat.warm_C, self._heat.warm_share, 1.0)

    def problems(self, sample: HandSample, connected_ns: int) -> list[str]:
        """What is wrong with palm and motors in this sample, in words."""
        problems = [f"only {sample.idle_us} us of idle time in the palm"] if sample.idle_us < SPARE_TIME_us else []
        for motor, flags in enumerate(sample.motor.flags.tolist()):
            problems += [f"{self._name(motor)}: {words}" for words in describe_flags(flags)]
        for motor in np.flatnonzero(sample.motor.temperature_C >= self._heat.warm_C).tolist():
            problems.append(f"{self._name(motor)}: warm, {sample.motor.temperature_C[motor]:.0f} C")
        silent_ns = sample.stamp_ns - np.maximum(sample.motor.torque_stamps_ns, connected_ns)
        silent = self._motors.is_fitted & (silent_ns > _TOLD_SILENT_s * NANOSECONDS)
        for motor in np.flatnonzero(silent).tolist():
            problems.append(f"{self._name(motor)}: silent")
        return problems

    def _flag_fault(self, motors: NDArray[np.intp], flags: NDArray[np.uint16], settling: bool) -> Fault | None:
        looked_at = self._serious & ~int(MotorFlag.NO_DEMAND) if settling else self._serious
        serious = [word & looked_at for word in flags.tolist()]
        if not any(serious):
            return None
        worst = serious.index(max(serious))
        words = ", ".join(describe_flags(serious[worst]))
        return Fault(f"stopped: {words}", self._name(int(motors[worst])), "Find the cause, then resume")

    def _heat_fault(self, motors: NDArray[np.intp], temperature_C: Array) -> Fault | None:
        if not (temperature_C >= self._heat.hot_C).any():
            return None
        worst = int(temperature_C.argmax())
        return Fault(
            f"stopped: {temperature_C[worst]:.0f} C, limit {self._heat.hot_C:.0f} C",
            self._name(int(motors[worst])),
            "Let the motor cool down, then resume",
        )

    def _name(self, motor: int) -> str:
        return f"{self._where}, {self._motors.names[motor]} (motor {motor})"
