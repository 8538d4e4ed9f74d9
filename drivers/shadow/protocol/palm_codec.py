"""Process image of the 0220 palm: 70 command bytes, 232 status bytes, little-endian and packed.

Layouts follow Shadow's ``0220_palm_edc`` headers (protocols: Palm images); each image ends with the 12 bytes of the
palm's CAN bridge. Every byte string of the right length decodes; what the values mean is for the device to judge. A
status answers the *previous* command: its data types and motor parity echo the command before the one in flight.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.core.errors import CodecError
from drivers.shadow.protocol.palm_messages import (
    MOTORS,
    MOTORS_PER_STATUS,
    OPTIONAL_CHANNELS,
    SENSORS,
    CanFrame,
    EdcCommand,
    PalmAuxiliary,
    PalmCommand,
    PalmStatus,
)

__all__ = [
    "CAN_BRIDGE",
    "MOTORS",
    "MOTORS_PER_STATUS",
    "OPTIONAL_CHANNELS",
    "SENSORS",
    "CanFrame",
    "EdcCommand",
    "PalmAuxiliary",
    "PalmCommand",
    "PalmStatus",
    "decode_command",
    "decode_status",
    "encode_command",
    "encode_status",
]

_WORD = np.dtype("<u2")
_SLOTS = (5, 16)
CAN_BRIDGE = np.dtype([("bus", "u1"), ("length", "u1"), ("id", "<u2"), ("data", "u1", 8)])

_COMMAND_FORMAT = struct.Struct("<IIhI20hI BBH8s")
_STATUS_SCALARS = struct.Struct("<I 74x IhII 40x IH 80x HBBH8s")  # without its arrays, which stand at:
_SENSORS_AT, _PACKETS_AT, _TACTILE_AT = 4, 92, 138
_STATUS_FORMAT = struct.Struct(f"<I37HIhII {'hH' * MOTORS_PER_STATUS} IH80sH BBH8s")


def encode_command(command: PalmCommand) -> bytes:
    """The 70 bytes of a command.

    Raises:
        CodecError: a value does not fit its field.
    """
    return _pack(
        _COMMAND_FORMAT,
        command.edc_command,
        command.from_motor_data_type,
        command.which_motors,
        command.to_motor_data_type,
        *_integers(command.motor_data),
        command.tactile_data_type,
        *_can_fields(command.can),
    )


def decode_command(payload: bytes) -> PalmCommand:
    """Read the 70 bytes of a command, as an emulated palm does.

    Raises:
        CodecError: wrong length.
    """
    edc_command, from_type, which_motors, to_type, *rest = _unpack(_COMMAND_FORMAT, payload, "command")
    motor_data, tactile_type, can = tuple(rest[:MOTORS]), rest[MOTORS], CanFrame(*rest[MOTORS + 1 :])
    return PalmCommand(edc_command, from_type, which_motors, to_type, motor_data, tactile_type, can)


def encode_status(status: PalmStatus) -> bytes:
    """The 232 bytes of a status, as an emulated palm sends them.

    Raises:
        CodecError: a value does not fit its field.
    """
    return _pack(
        _STATUS_FORMAT,
        status.edc_command,
        *_integers(status.sensors),
        status.motor_data_type,
        status.which_motors,
        status.arrived,
        status.had_errors,
        *_interleave(_integers(status.torque), _integers(status.misc)),
        status.tactile_data_type,
        status.tactile_valid,
        _exactly(80, np.asarray(status.tactile, np.uint8).tobytes(), "tactile slots"),
        status.idle_time_us,
        *_can_fields(status.can),
    )


def decode_status(payload: bytes) -> PalmStatus:
    """Read the 232 bytes of a status.

    Raises:
        CodecError: wrong length.
    """
    scalars = _unpack(_STATUS_SCALARS, payload, "status")
    edc_command, kind, which_motors, arrived, had_errors, tactile_type, tactile_valid, idle_time_us, *can = scalars
    packets = np.frombuffer(payload, _WORD, 2 * MOTORS_PER_STATUS, _PACKETS_AT)
    return PalmStatus(
        edc_command=edc_command,
        sensors=np.frombuffer(payload, _WORD, len(SENSORS), _SENSORS_AT),
        motor_data_type=kind,
        which_motors=which_motors,
        arrived=arrived,
        had_errors=had_errors,
        torque=packets[::2].view(np.int16),
        misc=packets[1::2],
        tactile_data_type=tactile_type,
        tactile_valid=tactile_valid,
        tactile=np.frombuffer(payload, np.uint8, _SLOTS[0] * _SLOTS[1], _TACTILE_AT).reshape(_SLOTS),
        idle_time_us=idle_time_us,
        can=CanFrame(*can),
    )


def _unpack(image: struct.Struct, payload: bytes, what: str) -> tuple[Any, ...]:
    if len(payload) != image.size:
        raise CodecError(
            f"a palm {what} of {len(payload)} bytes instead of {image.size}",
            where="palm 0220",
            hint="Check that the palm is a 0220 (product code 6)",
        )
    return image.unpack(payload)


def _can_fields(can: CanFrame) -> tuple[int, int, int, bytes]:
    return can.bus, can.length, can.identifier, _exactly(8, can.data, "CAN bridge data")


def _integers(values: Sequence[int] | NDArray[np.integer[Any]]) -> list[int]:
    return np.asarray(values).ravel().tolist()


def _interleave(torque: list[int], misc: list[int]) -> list[int]:
    return [word for packet in zip(torque, misc, strict=False) for word in packet]


def _exactly(length: int, data: bytes, what: str) -> bytes:
    if len(data) != length:
        raise CodecError(f"{what} of {len(data)} bytes instead of {length}", where="palm 0220")
    return data


def _pack(image: struct.Struct, *fields: int | bytes) -> bytes:
    """Pack with :mod:`struct`, which refuses what numpy would wrap around in silence."""
    try:
        return image.pack(*fields)
    except struct.error as error:
        raise CodecError(f"a value does not fit its field ({error})", where="palm 0220") from error
