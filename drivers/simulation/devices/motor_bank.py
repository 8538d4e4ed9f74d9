"""The emulated hand's motor boards: demands, halts, flags, answers (protocols: Motor demands; Motor answers)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import Array
from drivers.shadow.model.motors import DRIVEN_JOINTS, MotorMap
from drivers.shadow.protocol.motor_data import (
    CONFIG_TYPES,
    MAX_PWM,
    MAX_TORQUE,
    FromMotor,
    MotorFlag,
    ToMotor,
    config_crc,
)
from drivers.shadow.protocol.palm_codec import MOTORS, PalmCommand
from drivers.simulation.devices.geared_motors import motor_class
from drivers.simulation.hand_plant import HandPlant

DEMAND_TIMEOUT_ns = 20_000_000
"""A motor without a demand for this long halts."""

GAUGE_COUNTS_PER_Nm = 2000.0
"""Strain-gauge difference per joint torque (assumed; a real hand's depends on its gauges)."""

_GAUGE_NOISE = 2.0
_NO_DEMAND, _OVER_TEMPERATURE = int(MotorFlag.NO_DEMAND), int(MotorFlag.OVER_TEMPERATURE)
_GAUGE_MIDDLE = 2048
_SUPPLY_V, _AMBIENT_C, _HALT_C = 24.0, 25.0, 60.0
_STALL_RISE_C, _THERMAL_TIME_s = 80.0, 200.0
_WARMING_ns = 10_000_000  # interval at which the windings' temperature is updated
_SLOW_WORDS = (0, 1200, 1200, 0, 4711, 0, 131, 2020, 0x0A1F, 300, 4500, 0, 0, 0, 5, 5000, 0x0D)
"""Answers of the slow data types 0 to 0x10: firmware revision, serial, gear ratio, date, torque loop."""


class MotorBank:
    """All motor boards together, vectors by motor number.

    PWM and torque demands, configurations, backlash controls and resets are served. The torque loop runs once per
    command, not at 5 kHz. Its output is the duty cycle for this torque at a standstill, plus half of the error.

    Args:
        plant: the plant that the motors drive.
        motor_map: which motor pulls which joint.
        rng: noise of the strain gauges.

    Attributes:
        is_fitted: which motors there are, shape (20,); the others never answer.
        backlash_compensated: which motors have the compensation switched on, shape (20,).
    """

    def __init__(self, plant: HandPlant, motor_map: MotorMap, rng: np.random.Generator) -> None:
        self._plant, self._rng = plant, rng
        self._sign = motor_map.sign
        self.is_fitted = motor_map.is_fitted
        pulls = [motor_map.numbers.get(joint) for joint in DRIVEN_JOINTS]
        self._joint_from_motor = np.array([[float(motor == own) for motor in range(MOTORS)] for own in pulls])
        classes = [motor_class(joint) for joint in motor_map.names]
        self._stall_Nm = np.array([motor.stall_Nm for motor in classes])
        self._stall_mA = np.array([motor.stall_current_mA for motor in classes])
        self._pwm = np.zeros(MOTORS)
        self._flags = np.full(MOTORS, _NO_DEMAND)
        self._celsius = np.full(MOTORS, _AMBIENT_C)
        self._config = np.zeros((MOTORS, len(CONFIG_TYPES)), int)
        self._max_pwm = np.full(MOTORS, MAX_PWM)
        self._max_torque = np.full(MOTORS, MAX_TORQUE)
        self.backlash_compensated = np.zeros(MOTORS, bool)
        self._frames = np.zeros(MOTORS, int)
        self._halts_at_ns: int | None = None
        self._warmed_at_ns = plant.stamp_ns
        self._slow_turns = 0

    @property
    def next_event_ns(self) -> int | None:
        """When the motors halt unless a demand arrives before."""
        return self._halts_at_ns

    def tick(self) -> None:
        """Halt every motor until the next demand, because none arrived in time."""
        self._halts_at_ns = None
        self._flags |= _NO_DEMAND
        self._turn(np.zeros(MOTORS))

    def raise_flags(self, motor: int, flags: int) -> None:
        """Let a motor report flags (:class:`~drivers.shadow.protocol.motor_data.MotorFlag`) until it is reset."""
        self._flags[motor] |= flags

    def heat(self, motor: int, celsius: float) -> None:
        """Set the temperature of a motor's winding, degrees Celsius."""
        self._celsius[motor] = celsius

    def take(self, command: PalmCommand) -> None:
        """Pass a command's words on to the motors."""
        words = np.array(command.motor_data, int)
        kind = command.to_motor_data_type
        self._frames += 1
        self._warm()
        if kind == ToMotor.DEMAND_PWM:
            self._demand(words)
        elif kind == ToMotor.DEMAND_TORQUE:
            self._demand(self._torque_loop(words))
        elif kind == ToMotor.RESET:
            self._reset(words)
        elif kind in CONFIG_TYPES:
            self._config[:, kind - CONFIG_TYPES[0]] = words & 0xFFFF
        elif kind == ToMotor.CONFIG_CRC:
            self._activate(words & 0xFFFF)
        elif kind == ToMotor.SYSTEM_CONTROLS:
            self.backlash_compensated[words & 0x1 > 0] = True
            self.backlash_compensated[words & 0x2 > 0] = False

    def answer(self, kind: int) -> tuple[NDArray[np.int16], NDArray[np.uint16]]:
        """The (torque, misc) words of all motors for a requested data type, each of shape (20,)."""
        gauges = self._gauge_difference()
        if kind == FromMotor.SLOW_MISC:
            kind_now = self._slow_turns // 2 % (len(_SLOW_WORDS) - 1) + 1  # even and odd motors each cycle through all
            self._slow_turns += 1
            return np.full(MOTORS, kind_now, np.int16), np.full(MOTORS, _SLOW_WORDS[kind_now], np.uint16)
        return gauges.astype(np.int16), np.rint(self._misc(kind, gauges)).astype(np.int64).astype(np.uint16)

    def _misc(self, kind: int, gauges: Array) -> Array:
        match kind:
            case FromMotor.GAUGE_LEFT:
                return _GAUGE_MIDDLE + gauges / 2
            case FromMotor.GAUGE_RIGHT:
                return _GAUGE_MIDDLE - gauges / 2
            case FromMotor.PWM:
                return self._pwm
            case FromMotor.FLAGS:
                return np.asarray(self._flags, float)
            case FromMotor.CURRENT:
                return np.asarray(self._load * self._stall_mA)
            case FromMotor.VOLTAGE:
                return np.full(MOTORS, _SUPPLY_V * 256)
            case FromMotor.TEMPERATURE:
                return self._celsius * 256
            case FromMotor.CAN_RECEIVED | FromMotor.CAN_TRANSMITTED:
                return np.asarray(self._frames, float)
            case _:
                return np.zeros(MOTORS)

    @property
    def _torque_Nm(self) -> Array:
        return np.asarray(self._sign * (self._plant.motor_torque_Nm @ self._joint_from_motor))

    @property
    def _load(self) -> Array:
        """Share of the stall torque, which equals the share of the stall current."""
        return np.asarray(np.abs(self._torque_Nm) / self._stall_Nm)

    def _gauge_difference(self) -> Array:
        noise = _GAUGE_NOISE * self._rng.standard_normal(MOTORS)
        return np.minimum(np.maximum(np.rint(self._torque_Nm * GAUGE_COUNTS_PER_Nm + noise), -32768), 32767)

    def _demand(self, words: NDArray[np.int_]) -> None:
        self._flags &= ~_NO_DEMAND
        self._halts_at_ns = self._plant.stamp_ns + DEMAND_TIMEOUT_ns
        self._turn(np.minimum(np.maximum(words, -self._max_pwm), self._max_pwm))

    def _torque_loop(self, torques: NDArray[np.int_]) -> NDArray[np.int_]:
        """Duty cycles for torque demands in counts of the gauges, within the boards' torque limits."""
        wanted = np.minimum(np.maximum(torques, -self._max_torque), self._max_torque)
        missing = wanted - self._torque_Nm * GAUGE_COUNTS_PER_Nm
        return np.asarray(np.rint((wanted + 0.5 * missing) / (GAUGE_COUNTS_PER_Nm * self._stall_Nm) * MAX_PWM), int)

    def _turn(self, pwm: Array | NDArray[np.int_]) -> None:
        self._pwm = np.where(self._flags & _OVER_TEMPERATURE, 0.0, pwm)
        self._plant.drive(self._joint_from_motor @ (self._sign * self._pwm) / MAX_PWM)

    def _reset(self, words: NDArray[np.int_]) -> None:
        """Reset a motor, addressed by its number on its bus; it restarts halted and with its stored settings."""
        reset = words & 0xFFFF == 0x5200 | np.arange(MOTORS) % 10
        self._flags[reset] = _NO_DEMAND
        self._max_pwm[reset], self._max_torque[reset] = MAX_PWM, MAX_TORQUE
        self._turn(np.where(reset, 0.0, self._pwm))

    def _activate(self, checksums: NDArray[np.int_]) -> None:
        """Activate the uploaded configuration of every motor whose checksum is not 0, if the checksum is right."""
        for motor in np.flatnonzero(checksums):
            self._flags[motor] &= ~int(MotorFlag.CONFIG_CRC_MISMATCH | MotorFlag.CONFIG_OUT_OF_RANGE)
            max_pwm = self._config[motor, CONFIG_TYPES.index(ToMotor.MAX_PWM)]
            if config_crc(self._config[motor].tolist()) != checksums[motor]:
                self._flags[motor] |= int(MotorFlag.CONFIG_CRC_MISMATCH)
            elif max_pwm > MAX_PWM:
                self._flags[motor] |= int(MotorFlag.CONFIG_OUT_OF_RANGE)
            else:
                self._max_pwm[motor] = max_pwm
                self._max_torque[motor] = self._config[motor, CONFIG_TYPES.index(ToMotor.TORQUE_LIMIT)]

    def _warm(self) -> None:
        """Let windings approach the temperature of their present load; overheated motors halt permanently."""
        elapsed_ns = self._plant.stamp_ns - self._warmed_at_ns
        if elapsed_ns < _WARMING_ns:
            return
        self._warmed_at_ns += elapsed_ns
        final = _AMBIENT_C + _STALL_RISE_C * self._load**2
        self._celsius += (final - self._celsius) * (1 - math.exp(-elapsed_ns / NANOSECONDS / _THERMAL_TIME_s))
        if (hot := self._celsius > _HALT_C).any():
            self._flags[hot] |= _OVER_TEMPERATURE
