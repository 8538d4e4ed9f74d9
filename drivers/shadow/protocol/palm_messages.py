"""Messages between host and palm, independent of the palm's layout (protocols: Palm images; Joint sensors)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOTORS = 20
MOTORS_PER_STATUS = 10

Places = slice | NDArray[np.intp]
"""An index into an array."""

SENSORS: tuple[str, ...] = (
    *(f"{finger}J{number}" for finger in ("FF", "MF", "RF") for number in (1, 2, 3, 4)),
    *(f"LFJ{number}" for number in (1, 2, 3, 4, 5)),
    *("THJ1", "THJ2", "THJ3", "THJ4", "THJ5A", "THJ5B", "WRJ1A", "WRJ1B", "WRJ2"),
    *("ACCX", "ACCY", "ACCZ", "GYRX", "GYRY", "GYRZ", "AN0", "AN1", "AN2", "AN3", "UNUSED"),
)
"""The 37 analogue channels in the palm's order."""

OPTIONAL_CHANNELS = range(26, 32)
"""Accelerometer and gyroscope: a channel without hardware keeps its own index as its value."""


class EdcCommand(IntEnum):
    """Requests to the palm, and in a status what it did."""

    INVALID = 0  # in a status: the palm did not write in time
    SENSOR_DATA = 1
    CHANNEL_NUMBERS = 2
    CHIP_SELECTS = 3
    CAN_DIRECT = 4


@dataclass(frozen=True)
class CanFrame:
    """One frame of the palm's CAN bridge.

    Attributes:
        bus: 1 or 2 (0: no frame).
        length: bytes of ``data`` that count.
        identifier: 11-bit message identifier.
        data: always eight bytes.
    """

    bus: int = 0
    length: int = 0
    identifier: int = 0
    data: bytes = bytes(8)


NO_FRAME = CanFrame()


@dataclass(frozen=True, eq=False)
class PalmCommand:
    """One command to the palm; the default is the all-zero image, with which nothing moves.

    Attributes:
        edc_command: see :class:`EdcCommand`.
        from_motor_data_type: what the motors shall answer.
        which_motors: 0 asks the even motors, 1 the odd ones.
        to_motor_data_type: what ``motor_data`` means.
        motor_data: one word a motor, shape (20,), by motor number.
        tactile_data_type: what the fingertips shall answer.
        can: frame for the CAN bridge.
        imu_command: 0240 only: 1 sets the scales below.
        imu_scales: 0240 only: accelerometer and gyroscope.
        aux_data_type: 0230 only: what its auxiliary sensors shall answer.
    """

    edc_command: int = EdcCommand.INVALID
    from_motor_data_type: int = 0
    which_motors: int = 0
    to_motor_data_type: int = 0
    motor_data: Sequence[int] | NDArray[np.integer[Any]] = (0,) * MOTORS
    tactile_data_type: int = 0
    can: CanFrame = NO_FRAME
    imu_command: int = 0
    imu_scales: tuple[int, int] = (0, 0)
    aux_data_type: int = 0


@dataclass(frozen=True, eq=False)
class PalmAuxiliary:
    """What only the 0230 palm sends.

    Attributes:
        links: tactile words of the middle (first four) and proximal links, shape (5, 8), by finger.
        data_type: type of the auxiliary words.
        words: auxiliary sensors, shape (16,).
    """

    links: NDArray[np.uint16]
    data_type: int
    words: NDArray[np.uint16]


@dataclass(frozen=True, eq=False)
class PalmStatus:
    """One status of the palm.

    Attributes:
        edc_command: 1 for a valid status; 0 when the palm did not write in time.
        sensors: ADC counts, shape (37,), channels of :data:`SENSORS`.
        motor_data_type: type of the values in ``misc``.
        which_motors: 0 the even motors answered, 1 the odd ones.
        arrived: bit N set when motor N answered.
        had_errors: bit N set when motor N answered with another type.
        torque: strain-gauge difference of each packet, shape (10,); motor N is in packet N // 2.
        misc: the requested value of each packet, shape (10,), unsigned 16 bits.
        tactile_data_type: type of the fingertips' answer.
        tactile_valid: bit 0 FF, 1 MF, 2 RF, 3 LF, 4 TH.
        tactile: raw fingertip slots, shape (5, 16), bytes; (5, 32) of a 0230.
        idle_time_us: spare time in the palm's cycle; healthy above 50.
        can: frame from the CAN bridge.
        auxiliary: what only the 0230 sends.
    """

    edc_command: int
    sensors: NDArray[np.uint16]
    motor_data_type: int
    which_motors: int
    arrived: int
    had_errors: int
    torque: NDArray[np.int16]
    misc: NDArray[np.uint16]
    tactile_data_type: int
    tactile_valid: int
    tactile: NDArray[np.uint8]
    idle_time_us: int
    can: CanFrame = NO_FRAME
    auxiliary: PalmAuxiliary | None = None

    @property
    def written(self) -> bool:
        """Whether the palm wrote this status in time."""
        return self.edc_command == EdcCommand.SENSOR_DATA

    @property
    def heard_motors(self) -> NDArray[np.intp]:
        """Numbers of the motors that answered with the stated type, ascending."""
        return _marked_motors(self.arrived & ~self.had_errors, self.which_motors)

    @property
    def heard_places(self) -> tuple[Places, Places]:
        """Indices of :attr:`heard_motors` into arrays of motors, and into ``torque`` and ``misc``."""
        return _places(self.arrived & ~self.had_errors, self.which_motors)


@lru_cache(maxsize=64)
def _places(mask: int, which_motors: int) -> tuple[Places, Places]:
    motors = _marked_motors(mask, which_motors)
    if len(motors) == MOTORS_PER_STATUS:  # nearly always: slices are far quicker than lists of numbers
        return slice(which_motors, MOTORS, 2), slice(None)
    return motors, motors >> 1


@lru_cache(maxsize=64)
def _marked_motors(mask: int, which_motors: int) -> NDArray[np.intp]:
    """The even (0) or odd (1) motors whose bit is set; none for any other parity. Shared, so not writable."""
    asked = range(which_motors, MOTORS, 2) if which_motors in (0, 1) else range(0)
    motors = np.array([motor for motor in asked if mask >> motor & 1], dtype=np.intp)
    motors.flags.writeable = False
    return motors
