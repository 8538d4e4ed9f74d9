"""Words exchanged with the hand's 20 motors: data types, flags, units and the configuration checksum.

Codes are those of Shadow's ``simplemotor`` headers (protocols: Motor answers; Motor demands). Each motor packet
carries a strain-gauge difference (``torque``) and one further word (``misc``) whose meaning is the data type that was
asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum, IntFlag
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.errors import CodecError

MAX_PWM = 0x3FF
"""Full duty cycle of a motor's bridge, counts."""

MAX_TORQUE = 0x7FFF
"""Largest torque demand, counts of strain gauge difference."""


class FromMotor(IntEnum):
    """What a motor can be asked for."""

    INVALID = 0
    GAUGE_LEFT = 1
    GAUGE_RIGHT = 2
    PWM = 3
    FLAGS = 4
    CURRENT = 5
    VOLTAGE = 6
    TEMPERATURE = 7
    CAN_RECEIVED = 8
    CAN_TRANSMITTED = 9
    SLOW_MISC = 0xA
    CONFIG_READBACK = 0xB
    CAN_ERRORS = 0xC
    P_TERM = 0xD
    I_TERM = 0xE
    D_TERM = 0xF


class ToMotor(IntEnum):
    """What a motor can be sent. Types 5 to 0xE are its configuration, 0xF the checksum that activates it."""

    INVALID = 0
    DEMAND_TORQUE = 1
    DEMAND_PWM = 2
    RESET = 3
    SYSTEM_CONTROLS = 4
    TORQUE_LIMIT = 5
    TORQUE_LIMITER_GAIN = 6
    MAX_PWM = 7
    GAUGE_REFERENCES = 8
    F = 9
    P = 0xA
    I = 0xB  # noqa: E741  the gain's name
    D = 0xC
    I_MAX = 0xD
    DEADBAND_SIGN = 0xE
    CONFIG_CRC = 0xF


CONFIG_TYPES: tuple[ToMotor, ...] = tuple(ToMotor(code) for code in range(ToMotor.TORQUE_LIMIT, ToMotor.CONFIG_CRC))
"""The ten configuration words in the order they are sent and summed."""


class SlowData(IntEnum):
    """Types of :attr:`FromMotor.SLOW_MISC`: the type is in ``torque``, its value in ``misc``."""

    INVALID = 0
    SVN_REVISION = 1
    SERVER_SVN_REVISION = 2
    MODIFIED = 3
    SERIAL_LOW = 4
    SERIAL_HIGH = 5
    GEAR_RATIO = 6
    YEAR = 7
    MONTH_DAY = 8
    F = 9
    P = 0xA
    I = 0xB  # noqa: E741  the gain's name
    I_MAX = 0xC
    D = 0xD
    DEADBAND_SIGN = 0xE
    LOOP_FREQUENCY = 0xF
    GAUGE_TYPE = 0x10


class MotorFlag(IntFlag):
    """Bits of :attr:`FromMotor.FLAGS`; the lowest four are the top bits of the current limit."""

    CURRENT_CHOKE = 0x000F
    EEPROM_WRITING = 0x0010
    CONFIG_CRC_MISMATCH = 0x0020
    CONFIG_OUT_OF_RANGE = 0x0040
    JIGGLING = 0x0080
    MOTOR_ID_INVALID = 0x0200
    NO_DEMAND = 0x0400
    GAUGE_LEFT_FAULT = 0x0800
    GAUGE_RIGHT_FAULT = 0x1000
    BRIDGE_FAULT = 0x2000
    EEPROM_CRC_BAD = 0x4000
    OVER_TEMPERATURE = 0x8000


SERIOUS_FLAGS = int(
    MotorFlag.NO_DEMAND | MotorFlag.BRIDGE_FAULT | MotorFlag.EEPROM_CRC_BAD | MotorFlag.OVER_TEMPERATURE
)
"""Flags with which a motor halts itself."""

MOTOR_PATIENCE_s = 0.02
"""A motor that has seen no demand for so long halts itself."""

_FLAG_WORDS = {
    MotorFlag.EEPROM_WRITING: "writing its memory",
    MotorFlag.CONFIG_CRC_MISMATCH: "last configuration failed its checksum",
    MotorFlag.CONFIG_OUT_OF_RANGE: "last configuration out of range",
    MotorFlag.JIGGLING: "zeroing its strain gauges, not controlled",
    MotorFlag.MOTOR_ID_INVALID: "invalid motor id",
    MotorFlag.NO_DEMAND: "halted, no demand for 20 ms",
    MotorFlag.GAUGE_LEFT_FAULT: "left strain gauge faulty",
    MotorFlag.GAUGE_RIGHT_FAULT: "right strain gauge faulty",
    MotorFlag.BRIDGE_FAULT: "halted, H-bridge fault",
    MotorFlag.EEPROM_CRC_BAD: "halted, stored configuration damaged",
    MotorFlag.OVER_TEMPERATURE: "halted, over temperature",
}
_BIT_WORDS = tuple((int(flag), words) for flag, words in _FLAG_WORDS.items())  # plain numbers: asked at every cycle


def describe_flags(flags: int) -> tuple[str, ...]:
    """The flags of one motor in words, serious or not; empty when all is well.

    The current choke and bits without a published meaning are left out.
    """
    return tuple(words for bit, words in _BIT_WORDS if flags & bit)


def as_signed(misc: NDArray[np.uint16]) -> NDArray[np.int16]:
    """A ``misc`` word that holds a signed value, such as :attr:`FromMotor.PWM` (counts, +-1023)."""
    return misc.astype(np.uint16).view(np.int16)


def volts(misc: NDArray[np.uint16]) -> Array:
    """Supply voltage from :attr:`FromMotor.VOLTAGE`, 8.8 fixed point as Shadow's host library reads it, volts."""
    return np.asarray(misc / 256.0)


def celsius(misc: NDArray[np.uint16]) -> Array:
    """Temperature from :attr:`FromMotor.TEMPERATURE`, 8.8 fixed point, degrees Celsius."""
    return np.asarray(misc / 256.0)


_CRC_TERMS = (0x3096, 0x612C, 0xC419, 0x8832, 0x1064, 0x20C8, 0x4190, 0x8320)
"""What each bit of the table index adds. No textbook CRC: the terms are not a shift-register sequence."""


def crc16(data: bytes) -> int:
    """Shadow's 16-bit motor checksum of a byte string, starting from 0."""
    crc = 0
    for byte in data:
        crc = (crc >> 8) ^ _crc_step((crc ^ byte) & 0xFF)
    return crc


@lru_cache(maxsize=256)
def _crc_step(index: int) -> int:
    step = 0
    for bit, term in enumerate(_CRC_TERMS):
        step ^= term if index >> bit & 1 else 0
    return step


def config_crc(words: Sequence[int]) -> int:
    """Checksum that activates the configuration words of types 5 to 0xE.

    A result of 0 would mean "ignore my configuration" and is sent as 1.

    Raises:
        CodecError: not ten words of 16 bits.
    """
    if len(words) != len(CONFIG_TYPES) or not all(0 <= word <= 0xFFFF for word in words):
        raise CodecError(
            f"a motor configuration must have {len(CONFIG_TYPES)} words of 16 bits", where="motor configuration"
        )
    return crc16(b"".join(int(word).to_bytes(2, "little") for word in words)) or 1


def config_upload(words: Sequence[int]) -> tuple[tuple[ToMotor, int], ...]:
    """What to send to one motor in successive cycles to change its configuration, the checksum last.

    Every other motor gets 0 in these cycles.

    Raises:
        CodecError: as :func:`config_crc`.
    """
    return (*zip(CONFIG_TYPES, words, strict=True), (ToMotor.CONFIG_CRC, config_crc(words)))
