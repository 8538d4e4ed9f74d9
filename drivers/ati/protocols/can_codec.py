"""Messages of ATI's Net CAN OEM board: 11-bit identifiers, big-endian payloads (protocols: Net CAN OEM)."""

from __future__ import annotations

import struct
from enum import IntEnum

from drivers.core.errors import CodecError
from drivers.hardware.can_bus import CanFrame

DEFAULT_BASE = 0x20


class Op(IntEnum):
    """The low four bits of an identifier: the kind of request or answer."""

    GAUGES = 0
    GAUGES_SECOND = 1
    MATRIX = 2
    MATRIX_SECOND = 3
    MATRIX_THIRD = 4
    SERIAL = 5
    SELECT_CALIBRATION = 6
    COUNTS_PER_UNIT = 7
    UNITS = 8
    DIAGNOSTIC = 9
    RESET = 0xC
    SET_BASE = 0xD
    SET_BAUD = 0xE
    FIRMWARE = 0xF


STATUS_BITS = {
    0: "watchdog",
    1: "converter reading too high",
    2: "converter reading too low",
    3: "artificial analog ground out of range",
    4: "supply voltage too high",
    5: "supply voltage too low",
    6: "active calibration unusable",
    7: "EEPROM failure",
    8: "configuration invalid",
    11: "sensor temperature too high",
    12: "sensor temperature too low",
    14: "CAN bus error",
}
_ANY = 1 << 15
_FIRST, _SECOND, _FLOATS, _COUNTS = (struct.Struct(form) for form in (">H3h", ">3h", ">2f", ">2I"))


def identifier(op: Op, base: int = DEFAULT_BASE) -> int:
    """The identifier that requests and answers of one kind share."""
    return base << 4 | op


def split_identifier(word: int) -> tuple[int, Op]:
    """Base and kind of an identifier. Raises CodecError for a kind that does not exist."""
    try:
        return word >> 4, Op(word & 0xF)
    except ValueError as error:
        raise CodecError(f"identifier 0x{word:03x} is not a message of an F/T board", where="CAN") from error


def request(op: Op, data: bytes = b"", base: int = DEFAULT_BASE) -> CanFrame:
    """A request."""
    return CanFrame(identifier(op, base), data)


def encode_gauges(status: int, gauges: tuple[int, ...], base: int = DEFAULT_BASE) -> tuple[CanFrame, CanFrame]:
    """A reading of gauges 0 to 5 as two frames, for emulators. Raises CodecError if a word does not fit."""
    try:
        first = _FIRST.pack(status, *gauges[0::2])
        second = _SECOND.pack(*gauges[1::2])
    except struct.error as error:
        raise CodecError(f"gauges {gauges} with status {status} do not fit", where="CAN") from error
    return CanFrame(identifier(Op.GAUGES, base), first), CanFrame(identifier(Op.GAUGES_SECOND, base), second)


def decode_first(data: bytes) -> tuple[int, tuple[int, int, int]]:
    """Status, and gauges 0, 2, 4. Raises CodecError for a wrong length."""
    status, *gauges = _unpack(_FIRST, data)
    return status, (gauges[0], gauges[1], gauges[2])


def decode_second(data: bytes) -> tuple[int, int, int]:
    """Gauges 1, 3, 5. Raises CodecError for a wrong length."""
    gauges = _unpack(_SECOND, data)
    return gauges[0], gauges[1], gauges[2]


def encode_pair(first: float, second: float) -> bytes:
    """Two elements of the matrix, for emulators."""
    return _FLOATS.pack(first, second)


def decode_pair(data: bytes) -> tuple[float, float]:
    """Two elements of the matrix. Raises CodecError for a wrong length."""
    first, second = _unpack(_FLOATS, data)
    return first, second


def encode_counts(per_force: int, per_torque: int) -> bytes:
    """Counts per unit, for emulators."""
    return _COUNTS.pack(per_force, per_torque)


def decode_counts(data: bytes) -> tuple[int, int]:
    """Counts per force and per torque unit. Raises CodecError for a wrong length."""
    per_force, per_torque = _unpack(_COUNTS, data)
    return per_force, per_torque


def describe_status(status: int) -> tuple[str, ...]:
    """A status word in plain English; empty if healthy."""
    words = [text for bit, text in STATUS_BITS.items() if status >> bit & 1]
    if unnamed := status & ~_ANY & ~sum(1 << bit for bit in STATUS_BITS):
        words.append(f"undocumented status bits 0x{unnamed:04x}")
    if status & _ANY and not words:
        words.append("the board reports an error without naming it")
    return tuple(words)


def _unpack(form: struct.Struct, data: bytes) -> tuple[int, ...]:
    if len(data) != form.size:
        raise CodecError(f"{len(data)} data bytes instead of {form.size}", where="CAN")
    return form.unpack(data)
