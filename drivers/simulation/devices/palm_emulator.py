"""The hand's palm as seen from the wire: takes a command image and returns a status image one cycle later.

When a command arrives the palm reads joints, motors and fingertips, passes the demands on and writes a status into its
buffer; the host reads that status with its *next* command (protocols: Palm images; Palm timing). Unless sensor data
were requested the palm writes nothing, and an unwritten buffer reads as zeros.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.transports import Datagram
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.kinematics import JOINTS
from drivers.shadow.protocol.motor_data import FromMotor
from drivers.shadow.protocol.palm_codec import (
    MOTORS,
    MOTORS_PER_STATUS,
    SENSORS,
    CanFrame,
    EdcCommand,
    PalmAuxiliary,
    PalmCommand,
    PalmStatus,
)
from drivers.shadow.protocol.palm_images import PALMS, PalmImage
from drivers.shadow.protocol.palm_variants import MAGNETIC_TIP_BYTES
from drivers.simulation.devices.motor_bank import MotorBank
from drivers.simulation.hand_plant import HandPlant
from drivers.simulation.sections import TactileSection
from drivers.simulation.settings import JointSensorSettings

_ADC_FULL_SCALE = 4095
_ALL_OF = tuple(sum(1 << motor for motor in range(parity, MOTORS, 2)) for parity in (0, 1))
_IDLE_us, _IDLE_SPREAD_us = 410, 20
_TIP_BYTES = {"0230": 32, "0250": MAGNETIC_TIP_BYTES}  # other palms have what a fingertip of theirs sends


class JointSensors:
    """The joint sensors: true angles to ADC counts, with this session's bias, noise and rounding.

    Args:
        calibration: the hand's calibration, used in reverse.
        settings: size of the errors.
        rng: random numbers for the errors.
    """

    def __init__(self, calibration: JointCalibration, settings: JointSensorSettings, rng: np.random.Generator) -> None:
        self._calibration, self._rng = calibration, rng
        spread = [settings.wrist_bias_rad if name.startswith("WR") else settings.bias_rad for name in JOINTS]
        self._bias_rad = np.array(spread) * rng.standard_normal(len(JOINTS))
        self._noise_rad = settings.noise_rad

    def counts(self, joints_rad: Array) -> NDArray[np.uint16]:
        """One reading of all 37 channels for true angles of shape (24,)."""
        noise_rad = self._noise_rad * self._rng.standard_normal(len(joints_rad))
        counts = np.rint(self._calibration.raw_counts(joints_rad + self._bias_rad + noise_rad)).astype(np.int64)
        return np.minimum(np.maximum(counts, 0), _ADC_FULL_SCALE).astype(np.uint16)


class CanBuses(Protocol):
    """The motors' two CAN buses, as seen by the palm."""

    def transfer(self, frame: CanFrame) -> CanFrame:
        """Send a frame (none if length and bus are 0); returns a frame received meanwhile, or an empty one."""


class NoCan:
    """Buses without any traffic."""

    def transfer(self, frame: CanFrame) -> CanFrame:
        return CanFrame()


@dataclass
class PalmFaults:
    """Faults of the sensors and of the motors' answers, which may be changed while it runs.

    Attributes:
        silent: motors that do not answer.
        wrong_type: motors that answer with another type than was requested.
        stuck: counts that channels of joint sensors read regardless of their joints.
        frozen: channels that keep their last reading.
        torque: strain-gauge differences that motors report regardless of their load.
    """

    silent: set[int] = field(default_factory=set)
    wrong_type: set[int] = field(default_factory=set)
    stuck: dict[int, int] = field(default_factory=dict)
    frozen: set[int] = field(default_factory=set)
    torque: dict[int, int] = field(default_factory=dict)


class PalmEmulator:
    """Far end of the hand's transport.

    With broken motors it behaves as oddly as the firmware (protocols: Motor polling): the last packet keeps its old
    words if its motor is silent, a good answer clears the error bits of all motors before it, and an answer of a wrong
    type is marked as arrived *and* as an error.

    Args:
        plant: the physics behind the sensors.
        joints: joint sensors.
        motors: motor boards.
        tactile: fingertip slots.
        rng: random numbers for the palm's idle time.
        image: which palm it is.
        can: the motors' buses.
    """

    def __init__(
        self,
        plant: HandPlant,
        joints: JointSensors,
        motors: MotorBank,
        tactile: TactileSection,
        rng: np.random.Generator,
        image: PalmImage = PALMS["0220"],
        can: CanBuses | None = None,
    ) -> None:
        self._plant, self._joints, self._motors, self._tactile, self._rng = plant, joints, motors, tactile, rng
        self._image, self._can = image, can or NoCan()
        self._unwritten = bytes(image.status_bytes)
        self._buffer = self._unwritten
        self._outbox: list[Datagram] = []
        self._last_packet = (np.int16(0), np.uint16(0))
        self._shown = np.zeros(len(SENSORS), np.uint16)
        self._absent = set(np.flatnonzero(~motors.is_fitted).tolist())
        self.faults = PalmFaults()

    def write(self, payload: bytes) -> None:
        """Process a command; the status of the previous command can then be read."""
        before = self._buffer
        self._buffer = self.serve(payload) or self._unwritten
        self._outbox.append(Datagram(before, self._plant.stamp_ns))

    def read(self) -> list[Datagram]:
        """The statuses that have arrived since the last call."""
        arrived, self._outbox = self._outbox, []
        return arrived

    def serve(self, payload: bytes) -> bytes | None:
        """One cycle of the palm's firmware: returns the status for a command; None if it writes nothing.

        Raises:
            CodecError: the command has a wrong length.
        """
        command = self._image.decode_command(payload)
        status = self._status(command)
        self._motors.take(command)
        return None if status is None else self._image.encode_status(status)

    def _status(self, command: PalmCommand) -> PalmStatus | None:
        if command.edc_command == EdcCommand.CAN_DIRECT:
            return self._can_status(command)
        if command.edc_command != EdcCommand.SENSOR_DATA:
            return None
        parity = command.which_motors & 1
        arrived, had_errors, torque, misc = self._packets(command.from_motor_data_type, parity)
        valid, slots = self._tactile.answer(command.tactile_data_type)
        return PalmStatus(
            edc_command=EdcCommand.SENSOR_DATA,
            sensors=self._sensors(),
            motor_data_type=command.from_motor_data_type,
            which_motors=parity,
            arrived=arrived,
            had_errors=had_errors,
            torque=torque,
            misc=misc,
            tactile_data_type=command.tactile_data_type,
            tactile_valid=valid,
            tactile=self._tips(slots),
            idle_time_us=int(_IDLE_us + self._rng.integers(-_IDLE_SPREAD_us, _IDLE_SPREAD_us + 1)),
            auxiliary=self._auxiliary(command),
        )

    def _sensors(self) -> NDArray[np.uint16]:
        counts = self._joints.counts(self._plant.joints_rad)
        for channel in self.faults.frozen:
            counts[channel] = self._shown[channel]
        for channel, stuck in self.faults.stuck.items():
            counts[channel] = stuck
        self._shown = counts
        return counts

    def _packets(self, kind: int, parity: int) -> tuple[int, int, NDArray[np.int16], NDArray[np.uint16]]:
        """Arrived and error masks, and the ten packets' words."""
        torques, miscs = self._motors.answer(kind)
        for motor, counts in self.faults.torque.items():
            torques[motor] = counts
        torque, misc = torques[parity::2].copy(), miscs[parity::2].copy()
        if kind == FromMotor.INVALID:
            return 0, 0, torque, misc
        arrived, had_errors = _ALL_OF[parity], 0
        for motor in range(parity, MOTORS, 2):
            if motor in self.faults.silent or motor in self._absent:
                arrived &= ~(1 << motor)
                torque[motor >> 1], misc[motor >> 1] = self._last_packet if motor >> 1 == 9 else (0, 0)
            elif motor in self.faults.wrong_type:
                had_errors |= 1 << motor
            else:
                had_errors &= -1 << motor + 1
        self._last_packet = (torque[-1], misc[-1])
        return arrived, had_errors, torque, misc

    def _tips(self, slots: NDArray[np.uint8]) -> NDArray[np.uint8]:
        size = _TIP_BYTES.get(self._image.name, slots.shape[1])
        return np.hstack((slots, np.zeros((len(slots), size - slots.shape[1]), np.uint8)))

    def _auxiliary(self, command: PalmCommand) -> PalmAuxiliary | None:
        if self._image.name != "0230":
            return None
        return PalmAuxiliary(np.zeros((5, 8), np.uint16), command.aux_data_type, np.zeros(16, np.uint16))

    def _can_status(self, command: PalmCommand) -> PalmStatus:
        """The status in bridge mode, in which the palm only serves the CAN bridge (protocols: Motor CAN buses)."""
        received = self._can.transfer(command.can)
        return PalmStatus(
            edc_command=EdcCommand.SENSOR_DATA,
            sensors=np.zeros(37, np.uint16),
            motor_data_type=0,
            which_motors=0,
            arrived=0,
            had_errors=0,
            torque=np.zeros(MOTORS_PER_STATUS, np.int16),
            misc=np.zeros(MOTORS_PER_STATUS, np.uint16),
            tactile_data_type=0,
            tactile_valid=0,
            tactile=self._tips(np.zeros((5, 16), np.uint8)),
            idle_time_us=_IDLE_us,
            can=received,
            auxiliary=self._auxiliary(command),
        )
