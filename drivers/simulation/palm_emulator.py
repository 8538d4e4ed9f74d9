"""The hand's palm as seen from the wire: takes 70 command bytes, gives 232 status bytes one cycle later.

When a command arrives the palm reads joints, motors and fingertips, passes the demands on and leaves a status in its
buffer; the host collects that status with its *next* command (protocols A.3, A.12). A palm that was not asked for
sensor data writes nothing, and an unwritten buffer reads as zeros.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.links import Datagram
from drivers.shadow.joint_calibration import JointCalibration
from drivers.shadow.kinematics import JOINTS
from drivers.shadow.motor_data import FromMotor
from drivers.shadow.palm_codec import (
    MOTORS,
    STATUS_0220,
    EdcCommand,
    PalmCommand,
    PalmStatus,
    decode_command,
    encode_status,
)
from drivers.simulation.motor_bank import MotorBank
from drivers.simulation.plant import Plant
from drivers.simulation.settings import JointSensorSettings
from tactile_lab.geometry.contacts import Array

_UNWRITTEN = bytes(STATUS_0220.itemsize)
_ADC_FULL_SCALE = 4095
_ALL_OF = tuple(sum(1 << motor for motor in range(parity, MOTORS, 2)) for parity in (0, 1))
_IDLE_us, _IDLE_SPREAD_us = 410, 20


class TactileSection(Protocol):
    """The five fingertip slots of the palm's status."""

    def answer(self, data_type: int) -> tuple[int, NDArray[np.uint8]]:
        """Valid bits (bit 0 FF to bit 4 TH) and the slots, shape (5, 16), for a requested type."""


class NoTactile:
    """Fingertips that have no connection to the palm: nothing is ever valid."""

    def answer(self, data_type: int) -> tuple[int, NDArray[np.uint8]]:
        return 0, np.zeros((5, 16), np.uint8)


class JointSensors:
    """The joint sensors: true angles to ADC counts, with this session's bias, noise and rounding.

    Args:
        calibration: the hand's calibration, read backwards.
        settings: how large the errors are.
        rng: where they come from.
    """

    def __init__(self, calibration: JointCalibration, settings: JointSensorSettings, rng: np.random.Generator) -> None:
        self._calibration, self._rng = calibration, rng
        spread = [settings.wrist_bias_rad if name.startswith("WR") else settings.bias_rad for name in JOINTS]
        self._bias_rad = np.array(spread) * rng.standard_normal(len(JOINTS))
        self._noise_rad = settings.noise_rad

    def counts(self, joints_rad: Array) -> NDArray[np.uint16]:
        """One reading of all 37 channels for true angles of shape (24,)."""
        noise_rad = self._noise_rad * self._rng.standard_normal(len(joints_rad))
        counts = self._calibration.raw_counts(joints_rad + self._bias_rad + noise_rad)
        return np.minimum(np.maximum(np.rint(counts), 0.0), _ADC_FULL_SCALE).astype(np.uint16)


class PalmEmulator:
    """Far end of the hand's link.

    Args:
        plant: the physics behind the sensors.
        joints: joint sensors.
        motors: motor boards.
        tactile: fingertip slots.
        rng: spread of the palm's idle time.
    """

    def __init__(
        self, plant: Plant, joints: JointSensors, motors: MotorBank, tactile: TactileSection, rng: np.random.Generator
    ) -> None:
        self._plant, self._joints, self._motors, self._tactile, self._rng = plant, joints, motors, tactile, rng
        self._buffer = _UNWRITTEN
        self._outbox: list[Datagram] = []

    def write(self, payload: bytes) -> None:
        """Take a command; the status of the command before becomes ready to read."""
        command = decode_command(payload)
        self._outbox.append(Datagram(self._buffer, self._plant.stamp_ns))
        self._buffer = self._status(command)
        self._motors.take(command)

    def read(self) -> list[Datagram]:
        """The statuses that came back since the last call."""
        arrived, self._outbox = self._outbox, []
        return arrived

    def _status(self, command: PalmCommand) -> bytes:
        if command.edc_command != EdcCommand.SENSOR_DATA:
            return _UNWRITTEN
        parity = command.which_motors & 1
        torque, misc = self._motors.answer(command.from_motor_data_type)
        valid, slots = self._tactile.answer(command.tactile_data_type)
        asked = command.from_motor_data_type != FromMotor.INVALID
        status = PalmStatus(
            edc_command=EdcCommand.SENSOR_DATA,
            sensors=self._joints.counts(self._plant.joints_rad),
            motor_data_type=command.from_motor_data_type,
            which_motors=parity,
            arrived=_ALL_OF[parity] if asked else 0,
            had_errors=0,
            torque=torque[parity::2],
            misc=misc[parity::2],
            tactile_data_type=command.tactile_data_type,
            tactile_valid=valid,
            tactile=slots,
            idle_time_us=int(_IDLE_us + self._rng.integers(-_IDLE_SPREAD_us, _IDLE_SPREAD_us + 1)),
        )
        return encode_status(status)
