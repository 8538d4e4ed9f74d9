"""Messages between the session and the arm's own process (protocols: Universal Robots). Little-endian.

A command is that of every positioner (:mod:`drivers.positioner.codec`) with what the arm shall do; a status is that of
every positioner with the state of the arm. So a recording holds whatever the arm said of itself.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag

import numpy as np

from drivers.core.errors import CodecError
from drivers.positioner.codec import (
    MESSAGE_BYTES,
    PositionerCommand,
    PositionerStatus,
    decode_command,
    decode_status,
    encode_command,
    encode_status,
)

_STATE = struct.Struct("<dbbId3dB")

COMMAND_BYTES = MESSAGE_BYTES + 1
STATUS_BYTES = MESSAGE_BYTES + _STATE.size
"""Lengths of a command and of a status."""


class ArmOrder(IntEnum):
    """What the arm shall do: follow targets, be led by hand, or take its program up again after a stop."""

    FOLLOW = 1
    FREEDRIVE = 2
    RESUME = 3


class ArmFlags(IntFlag):
    """What the arm's process knows: the arm answers, its program runs, it can be led by hand, it was braked."""

    HEARD = 1
    PROGRAM = 2
    FREE = 4
    BRAKED = 8


@dataclass(frozen=True)
class ArmState:
    """What the arm says of itself.

    Attributes:
        time_s: the arm's clock.
        robot_mode: 7 when it is ready; see :mod:`drivers.positioner.ur.checks` for the others.
        runtime_state: 2 while a program runs.
        safety_bits: ``safety_status_bits`` of RTDE; 1 when all is well.
        speed_fraction: where the speed slider stands, 0 to 1.
        force_N: force that it feels at the tool centre, base frame.
        flags: what its process knows.
    """

    time_s: float
    robot_mode: int
    runtime_state: int
    safety_bits: int
    speed_fraction: float
    force_N: tuple[float, float, float]
    flags: ArmFlags


@dataclass(frozen=True, eq=False)
class ArmStatus(PositionerStatus):
    """A positioner's status with the state of the arm."""

    arm: ArmState


@dataclass(frozen=True, eq=False)
class ArmCommand(PositionerCommand):
    """A positioner's command with what the arm shall do."""

    order: ArmOrder = ArmOrder.FOLLOW


def encode_arm_command(command: PositionerCommand, order: ArmOrder) -> bytes:
    """The bytes of a command. Raises CodecError if a value does not fit."""
    return encode_command(command) + bytes([order])


def decode_arm_command(payload: bytes) -> ArmCommand:
    """Read a command. Raises CodecError for other bytes."""
    if len(payload) != COMMAND_BYTES:
        raise CodecError(f"a command of {len(payload)} bytes instead of {COMMAND_BYTES}", where="arm")
    plain, order = decode_command(payload[:MESSAGE_BYTES]), payload[MESSAGE_BYTES]
    if order not in set(ArmOrder):
        raise CodecError(f"an order {order} that does not exist", where="arm")
    return ArmCommand(plain.sequence, plain.targets, ArmOrder(order))


def encode_arm_status(status: PositionerStatus) -> bytes:
    """The bytes of an :class:`ArmStatus`. Raises CodecError if a value does not fit."""
    assert isinstance(status, ArmStatus)
    arm = status.arm
    try:
        state = _STATE.pack(
            arm.time_s,
            arm.robot_mode,
            arm.runtime_state,
            arm.safety_bits,
            arm.speed_fraction,
            *arm.force_N,
            arm.flags,
        )
    except struct.error as error:
        raise CodecError(f"a value does not fit its field ({error})", where="arm") from error
    return encode_status(status) + state


def decode_arm_status(payload: bytes) -> ArmStatus:
    """Read a status. Raises CodecError for other bytes."""
    if len(payload) != STATUS_BYTES:
        raise CodecError(f"a status of {len(payload)} bytes instead of {STATUS_BYTES}", where="arm")
    plain = decode_status(payload[:MESSAGE_BYTES])
    time_s, mode, runtime, safety, fraction, x, y, z, flags = _STATE.unpack(payload[MESSAGE_BYTES:])
    if not np.isfinite([time_s, fraction, x, y, z]).all() or flags > sum(ArmFlags):
        raise CodecError("a state of the arm that cannot be", where="arm")
    return ArmStatus(
        plain.sequence, plain.q, ArmState(time_s, mode, runtime, safety, fraction, (x, y, z), ArmFlags(flags))
    )
