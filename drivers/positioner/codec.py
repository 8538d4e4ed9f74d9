"""Bytes of the six-axis positioner: 52 in each direction, little-endian (protocols: Positioner messages).

A command is a sequence number (u32) and six targets (f64): x, y, z in metres, yaw, pitch, roll in radians. Sequence
number 0 is a question: it moves nothing and asks where the axes stand. A status is the sequence number of the last
command taken and six measured positions.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import CodecError

_FORMAT = struct.Struct("<I6d")

MESSAGE_BYTES = _FORMAT.size
"""Length of a command and of a status."""

QUESTION = 0
"""Sequence number of a command that moves nothing."""

LARGEST_SEQUENCE = 0xFFFFFFFF


@dataclass(frozen=True, eq=False)
class PositionerCommand:
    """One command.

    Attributes:
        sequence: 1 and up; 0 for a question.
        targets: shape (6,), metres and radians; None for a question.
    """

    sequence: int
    targets: Array | None


@dataclass(frozen=True, eq=False)
class PositionerStatus:
    """One status.

    Attributes:
        sequence: that of the last command taken.
        q: measured axes, shape (6,), metres and radians.
    """

    sequence: int
    q: Array


def encode_command(command: PositionerCommand) -> bytes:
    """The bytes of a command; those of a question carry zeros.

    Raises:
        CodecError: a value does not fit.
    """
    if (command.targets is None) != (command.sequence == QUESTION):
        raise CodecError("a request for the position has sequence number 0 and no targets", where="positioner")
    return _pack(command.sequence, np.zeros(6) if command.targets is None else command.targets)


def decode_command(payload: bytes) -> PositionerCommand:
    """Read a command, as an emulated positioner does.

    Raises:
        CodecError: wrong length.
    """
    sequence, values = _unpack(payload, "command")
    return PositionerCommand(sequence, None if sequence == QUESTION else values)


def encode_status(status: PositionerStatus) -> bytes:
    """The bytes of a status, as an emulated positioner sends them.

    Raises:
        CodecError: a value does not fit.
    """
    return _pack(status.sequence, status.q)


def decode_status(payload: bytes) -> PositionerStatus:
    """Read a status.

    Raises:
        CodecError: wrong length.
    """
    return PositionerStatus(*_unpack(payload, "status"))


def _pack(sequence: int, values: Array) -> bytes:
    try:
        return _FORMAT.pack(sequence, *np.asarray(values, dtype=float).tolist())
    except struct.error as error:
        raise CodecError(f"a value does not fit its field ({error})", where="positioner") from error


def _unpack(payload: bytes, what: str) -> tuple[int, Array]:
    if len(payload) != MESSAGE_BYTES:
        raise CodecError(f"a {what} of {len(payload)} bytes instead of {MESSAGE_BYTES}", where="positioner")
    sequence, *values = _FORMAT.unpack(payload)
    return sequence, np.array(values)


@dataclass(frozen=True)
class PositionerCodec:
    """A positioner's messages: pure functions between bytes and values, for the device and for its emulator.

    Attributes:
        encode_command, encode_status: any command or status to bytes.
        decode_command, decode_status: the reverse; raise CodecError for other bytes.
    """

    encode_command: Callable[[PositionerCommand], bytes]
    decode_command: Callable[[bytes], PositionerCommand]
    encode_status: Callable[[PositionerStatus], bytes]
    decode_status: Callable[[bytes], PositionerStatus]


BINARY = PositionerCodec(encode_command, decode_command, encode_status, decode_status)
"""The form of this module's text."""
