"""Identifiers on the motors' two CAN buses (protocols: Motor CAN buses).

After Shadow's ``simplemotor`` and bootloader headers. Eleven bits: direction, motor number on its bus,
acknowledgement, data type. Motors 0 to 9 of the hand are on bus 1, 10 to 19 on bus 2, numbered 0 to 9 on each.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from drivers.core.errors import CodecError
from drivers.shadow.protocol.motor_data import FromMotor, ToMotor

MOTORS_PER_BUS = 10
BITRATE = 1_000_000


class Direction(IntEnum):
    """Bits 10 and 9."""

    REQUEST = 0
    TO_MOTOR = 1
    FROM_MOTOR = 2
    BOOTLOADER = 3


class BootCommand(IntEnum):
    """Commands of the motors' bootloader; a motor acknowledges with the same identifier, bit 4 set."""

    WRITE_DATA = 0
    READ = 1
    ERASE = 2
    RESET = 3
    VERSION = 4
    WRITE_ADDRESS = 5
    START = 6
    MAGIC = 0xA


@dataclass(frozen=True)
class MotorIdentifier:
    """An identifier, taken apart.

    Attributes:
        direction: see :class:`Direction`.
        number: the motor on its bus, 0 to 9; up to 15 fit.
        kind: data type, bootloader command, or whatever the direction means by it.
        acknowledged: the bootloader's acknowledgement bit.
    """

    direction: Direction
    number: int
    kind: int
    acknowledged: bool = False

    @property
    def identifier(self) -> int:
        """The eleven bits.

        Raises:
            CodecError: a part does not fit.
        """
        if not (0 <= self.number <= 15 and 0 <= self.kind <= 15):
            raise CodecError(f"motor {self.number}, type {self.kind} do not fit an identifier", where="motor CAN bus")
        return self.direction << 9 | self.number << 5 | self.acknowledged << 4 | self.kind

    @classmethod
    def of(cls, identifier: int) -> MotorIdentifier:
        """Take eleven bits apart.

        Raises:
            CodecError: more than eleven bits.
        """
        if not 0 <= identifier <= 0x7FF:
            raise CodecError(f"identifier 0x{identifier:X} has more than eleven bits", where="motor CAN bus")
        return cls(Direction(identifier >> 9), identifier >> 5 & 0xF, identifier & 0xF, bool(identifier & 0x10))

    def motor(self, bus: int) -> int:
        """Number of the motor in the hand, 0 to 19, for bus 1 or 2.

        Raises:
            CodecError: no such bus or motor.
        """
        if bus not in (1, 2) or self.number >= MOTORS_PER_BUS:
            raise CodecError(f"no motor {self.number} on bus {bus}", where="motor CAN bus")
        return (bus - 1) * MOTORS_PER_BUS + self.number

    def __str__(self) -> str:
        """In words: ``motor 5 answers PWM``."""
        motor = f"motor {self.number}"
        if self.direction is Direction.FROM_MOTOR:
            return f"{motor} answers {FromMotor(self.kind).name}"
        if self.direction is Direction.TO_MOTOR:
            return f"{motor} is sent {ToMotor(self.kind).name}"
        if self.direction is Direction.REQUEST:
            return f"request for {FromMotor(self.kind).name} from the motors"
        command = BootCommand(self.kind).name if self.kind in set(BootCommand) else f"command {self.kind}"
        return f"{motor} acknowledges {command}" if self.acknowledged else f"bootloader of {motor}: {command}"


def bus_of(motor: int) -> tuple[int, int]:
    """Bus 1 or 2 and the number on it, for a motor 0 to 19 of the hand."""
    return motor // MOTORS_PER_BUS + 1, motor % MOTORS_PER_BUS
