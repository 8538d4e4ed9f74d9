"""The calibration that a Digital F/T sensor stores in its holding registers (protocols: Digital F/T)."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np

from drivers.ati.protocols.cal_file import FORCE_UNITS_N, TORQUE_UNITS_Nm
from drivers.core.contacts import Array
from drivers.core.errors import CodecError

FIRST_REGISTER, REGISTERS_EACH = 0x00E3, 192
BLOCK = struct.Struct(">8s32s4s20s36fBB6fii6H6H6B6B6H16s16s")
"""Serial, part, family, time, matrix, units, ratings, counts per force and torque, gauge settings, two remarks."""

FORCE_UNITS = ("lbf", "N", "klbf", "kN", "kg", "g")
TORQUE_UNITS = ("lbf-in", "lbf-ft", "Nm", "Nmm", "kg-cm", "kN-m")
"""Units by their code; codes start at 1."""


@dataclass(frozen=True)
class DigitalCalibration:
    """Converts gauge counts into a wrench.

    Attributes:
        serial, part_number: of the sensor.
        matrix: from counts of gauges 0 to 5 to counts of force and torque, shape (6, 6).
        force_unit, torque_unit: of the counts per unit.
        counts_per_force, counts_per_torque: scale.
        ratings: calibrated range of each axis, in those units, shape (6,).
        calibrated: the date, as the sensor states it.
    """

    serial: str
    part_number: str
    matrix: Array
    force_unit: str
    torque_unit: str
    counts_per_force: int
    counts_per_torque: int
    ratings: Array
    calibrated: str = ""

    @property
    def working_matrix(self) -> Array:
        """Matrix from gauge counts to newtons and newton metres, shape (6, 6)."""
        scale = np.repeat(
            [
                FORCE_UNITS_N[self.force_unit] / self.counts_per_force,
                TORQUE_UNITS_Nm[self.torque_unit] / self.counts_per_torque,
            ],
            3,
        )
        return np.asarray(self.matrix * scale[:, None])

    @property
    def ranges_SI(self) -> Array:
        """Calibrated range of each axis in newtons and newton metres, shape (6,)."""
        units = np.repeat([FORCE_UNITS_N[self.force_unit], TORQUE_UNITS_Nm[self.torque_unit]], 3)
        return np.asarray(self.ratings * units)


def unit_names(force_code: int, torque_code: int) -> tuple[str, str]:
    """Names of the unit codes. Raises CodecError for an unknown code."""
    if not (1 <= force_code <= len(FORCE_UNITS) and 1 <= torque_code <= len(TORQUE_UNITS)):
        raise CodecError(f"unknown unit codes {force_code} and {torque_code}", where="ATI calibration")
    return FORCE_UNITS[force_code - 1], TORQUE_UNITS[torque_code - 1]


def check_matrix(matrix: Array, counts_per_force: float, counts_per_torque: float, where: str) -> None:
    """Raises CodecError if these values cannot be a calibration."""
    if not np.isfinite(matrix).all() or not np.abs(matrix).sum(axis=1).all():
        raise CodecError("the calibration matrix is empty or not finite", where=where, hint="Choose another slot")
    if min(counts_per_force, counts_per_torque) <= 0:
        raise CodecError("the calibration has no scale", where=where, hint="Choose another slot")


def decode_block(block: bytes) -> DigitalCalibration:
    """Decode a calibration block.

    Raises:
        CodecError: the length is wrong, or the block cannot be a calibration (an empty slot, for example).
    """
    if len(block) != BLOCK.size:
        raise CodecError(f"{len(block)} bytes instead of {BLOCK.size}", where="ATI calibration block")
    serial, part, _, time, *rest = BLOCK.unpack(block)
    matrix, (force_code, torque_code), ratings = np.array(rest[:36]).reshape(6, 6), rest[36:38], np.array(rest[38:44])
    force_unit, torque_unit = unit_names(force_code, torque_code)
    check_matrix(matrix, rest[44], rest[45], "ATI calibration block")
    scale = rest[44], rest[45]
    return DigitalCalibration(
        _text(serial), _text(part), matrix, force_unit, torque_unit, *scale, ratings, calibrated=_text(time)
    )


def encode_block(calibration: DigitalCalibration) -> bytes:
    """A calibration as the sensor holds it, for emulators; gauge settings are zero. Raises CodecError."""
    try:
        return BLOCK.pack(
            calibration.serial.encode("ascii"),
            calibration.part_number.encode("ascii"),
            b"",
            calibration.calibrated.encode("ascii"),
            *calibration.matrix.ravel().tolist(),
            FORCE_UNITS.index(calibration.force_unit) + 1,
            TORQUE_UNITS.index(calibration.torque_unit) + 1,
            *calibration.ratings.tolist(),
            calibration.counts_per_force,
            calibration.counts_per_torque,
            *[0] * 30,
            b"",
            b"",
        )
    except (struct.error, ValueError, OverflowError) as error:
        raise CodecError(f"does not fit the block ({error})", where="ATI calibration block") from error


def _text(raw: bytes) -> str:
    return raw.split(b"\0", 1)[0].decode("ascii", "replace").strip()
