"""Process images of the rarer palms: 0240 with its motion sensor, 0230 with tactile links, 0250 with magnetic tips.

Layouts follow Shadow's headers (protocols: Palm images; Palm 0250); each ends with the CAN bridge's 12 bytes. The
0240's status is that of the 0220, the 0250's command that of the 0240. What a magnetic fingertip's 78 bytes mean is not
known: they are kept unchanged.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

from drivers.core.errors import CodecError
from drivers.shadow.protocol.palm_codec import (
    MOTORS,
    MOTORS_PER_STATUS,
    SENSORS,
    CanFrame,
    PalmAuxiliary,
    PalmCommand,
    PalmStatus,
)

_COMMAND_0240 = struct.Struct("<IIhI20hI H2B BBH8s")
_COMMAND_0230 = struct.Struct("<IIhI II 20h BBH8s")
_STATUS_0230 = struct.Struct(f"<I37H 40H IH160s I16H IhII {'hH' * MOTORS_PER_STATUS} H BBH8s")
_STATUS_0250 = struct.Struct(f"<I37H IH390s IhII {'hH' * MOTORS_PER_STATUS} H BBH8s")
_FINGERS, _TIP_BYTES, _LINK_WORDS, _AUX_WORDS = 5, 32, 8, 16
MAGNETIC_TIP_BYTES = 78
"""Of each fingertip in the status of a 0250 palm."""


def encode_command_0240(command: PalmCommand) -> bytes:
    """The 74 bytes of a command to a 0240 palm.

    Raises:
        CodecError: a value does not fit its field.
    """
    fields = (*_head(command), *_words(command.motor_data), command.tactile_data_type)
    return _pack(_COMMAND_0240, "0240", *fields, command.imu_command, *command.imu_scales, *_can(command.can))


def decode_command_0240(payload: bytes) -> PalmCommand:
    """Read the 74 bytes of a command, as an emulated 0240 palm does.

    Raises:
        CodecError: wrong length.
    """
    edc, from_type, which, to_type, *rest = _unpack(_COMMAND_0240, payload, "0240", "command")
    tactile_type, imu, accelerometer, gyroscope = rest[MOTORS : MOTORS + 4]
    can, scales = CanFrame(*rest[MOTORS + 4 :]), (accelerometer, gyroscope)
    return PalmCommand(edc, from_type, which, to_type, tuple(rest[:MOTORS]), tactile_type, can, imu, scales)


def encode_command_0230(command: PalmCommand) -> bytes:
    """The 74 bytes of a command to a 0230 palm.

    Raises:
        CodecError: a value does not fit its field.
    """
    fields = (*_head(command), command.tactile_data_type, command.aux_data_type)
    return _pack(_COMMAND_0230, "0230", *fields, *_words(command.motor_data), *_can(command.can))


def decode_command_0230(payload: bytes) -> PalmCommand:
    """Read the 74 bytes of a command, as an emulated 0230 palm does.

    Raises:
        CodecError: wrong length.
    """
    edc, from_type, which, to_type, tactile, aux, *rest = _unpack(_COMMAND_0230, payload, "0230", "command")
    motor_data, can = tuple(rest[:MOTORS]), CanFrame(*rest[MOTORS:])
    return PalmCommand(edc, from_type, which, to_type, motor_data, tactile, can, aux_data_type=aux)


def encode_status_0230(status: PalmStatus) -> bytes:
    """The 428 bytes of a 0230 palm's status, as an emulated one sends them.

    Raises:
        CodecError: a value does not fit its field, or the auxiliary part is missing.
    """
    if status.auxiliary is None:
        raise CodecError("a status without its auxiliary part", where="palm 0230")
    return _pack(
        _STATUS_0230,
        "0230",
        status.edc_command,
        *_words(status.sensors),
        *_words(status.auxiliary.links),
        status.tactile_data_type,
        status.tactile_valid,
        np.asarray(status.tactile, np.uint8).tobytes(),
        status.auxiliary.data_type,
        *_words(status.auxiliary.words),
        *_motor_fields(status),
    )


def decode_status_0230(payload: bytes) -> PalmStatus:
    """Read the 428 bytes of a 0230 palm's status.

    Raises:
        CodecError: wrong length.
    """
    edc, *rest = _unpack(_STATUS_0230, payload, "0230", "status")
    sensors, rest = rest[: len(SENSORS)], rest[len(SENSORS) :]
    links, rest = rest[: _FINGERS * _LINK_WORDS], rest[_FINGERS * _LINK_WORDS :]
    (tactile_type, valid, tips, aux_type), rest = rest[:4], rest[4:]
    aux, rest = rest[:_AUX_WORDS], rest[_AUX_WORDS:]
    words = np.array(links, np.uint16).reshape(_FINGERS, _LINK_WORDS)
    return PalmStatus(
        edc_command=edc,
        sensors=np.array(sensors, np.uint16),
        **_of_motors(rest),
        tactile_data_type=tactile_type,
        tactile_valid=valid,
        tactile=np.frombuffer(tips, np.uint8).reshape(_FINGERS, _TIP_BYTES),
        auxiliary=PalmAuxiliary(words, aux_type, np.array(aux, np.uint16)),
    )


def encode_status_0250(status: PalmStatus) -> bytes:
    """The 542 bytes of a 0250 palm's status, as an emulated one sends them.

    Raises:
        CodecError: a value does not fit its field.
    """
    return _pack(
        _STATUS_0250,
        "0250",
        status.edc_command,
        *_words(status.sensors),
        status.tactile_data_type,
        status.tactile_valid,
        np.asarray(status.tactile, np.uint8).tobytes(),
        *_motor_fields(status),
    )


def decode_status_0250(payload: bytes) -> PalmStatus:
    """Read the 542 bytes of a 0250 palm's status.

    Raises:
        CodecError: wrong length.
    """
    edc, *rest = _unpack(_STATUS_0250, payload, "0250", "status")
    sensors, rest = rest[: len(SENSORS)], rest[len(SENSORS) :]
    (tactile_type, valid, tips), rest = rest[:3], rest[3:]
    return PalmStatus(
        edc_command=edc,
        sensors=np.array(sensors, np.uint16),
        **_of_motors(rest),
        tactile_data_type=tactile_type,
        tactile_valid=valid,
        tactile=np.frombuffer(tips, np.uint8).reshape(_FINGERS, MAGNETIC_TIP_BYTES),
    )


def _motor_fields(status: PalmStatus) -> tuple[Any, ...]:
    """What ends a status: the motors' part, idle time, and the bridge's."""
    packets = [word for packet in zip(_words(status.torque), _words(status.misc), strict=True) for word in packet]
    head = status.motor_data_type, status.which_motors, status.arrived, status.had_errors
    return (*head, *packets, status.idle_time_us, *_can(status.can))


def _of_motors(fields: Sequence[Any]) -> dict[str, Any]:
    """The inverse of :func:`_motor_fields`, by the names of :class:`PalmStatus`."""
    (kind, which_motors, arrived, had_errors), rest = fields[:4], fields[4:]
    packets, (idle_us, *can) = rest[: 2 * MOTORS_PER_STATUS], rest[2 * MOTORS_PER_STATUS :]
    return {
        "motor_data_type": kind,
        "which_motors": which_motors,
        "arrived": arrived,
        "had_errors": had_errors,
        "torque": np.array(packets[::2], np.int16),
        "misc": np.array(packets[1::2], np.uint16),
        "idle_time_us": idle_us,
        "can": CanFrame(*can),
    }


def _head(command: PalmCommand) -> tuple[int, int, int, int]:
    return command.edc_command, command.from_motor_data_type, command.which_motors, command.to_motor_data_type


def _words(values: Any) -> list[int]:
    words: list[int] = np.asarray(values).ravel().tolist()
    return words


def _can(can: CanFrame) -> tuple[int, int, int, bytes]:
    return can.bus, can.length, can.identifier, can.data


def _unpack(image: struct.Struct, payload: bytes, palm: str, what: str) -> tuple[Any, ...]:
    if len(payload) != image.size:
        raise CodecError(
            f"a palm {what} of {len(payload)} bytes instead of {image.size}",
            where=f"palm {palm}",
            hint="Check that hand.palm in the rig file is the installed palm",
        )
    return image.unpack(payload)


def _pack(image: struct.Struct, palm: str, *fields: int | bytes) -> bytes:
    _check_bytes(image, palm, fields)
    try:
        return image.pack(*fields)
    except struct.error as error:
        raise CodecError(f"a value does not fit its field ({error})", where=f"palm {palm}") from error


def _check_bytes(image: struct.Struct, palm: str, fields: tuple[int | bytes, ...]) -> None:
    """:mod:`struct` cuts or fills byte strings in silence."""
    tips = {_STATUS_0230: _TIP_BYTES, _STATUS_0250: MAGNETIC_TIP_BYTES}
    sizes = {8, _FINGERS * tips[image]} if image in tips else {8}
    if any(isinstance(field, bytes) and len(field) not in sizes for field in fields):
        raise CodecError("a byte field has a wrong length", where=f"palm {palm}")
