"""Registers of an EtherCAT slave controller: addresses, states and their descriptions, SyncManagers and FMMUs.

Addresses follow Beckhoff's register description of the ET1100 and ET1200 family, the meanings of status codes ETG.1020
(protocols: Slave registers).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum

from drivers.core.errors import CodecError


class Register(IntEnum):
    """Addresses of registers and register blocks."""

    INFORMATION = 0x0000
    STATION_ADDRESS = 0x0010
    DL_CONTROL = 0x0100
    DL_STATUS = 0x0110
    AL_CONTROL = 0x0120
    AL_STATUS = 0x0130
    ESC_CONFIGURATION = 0x0141
    ERROR_COUNTERS = 0x0300
    LOST_LINKS = 0x0310
    WATCHDOG_DIVIDER = 0x0400
    WATCHDOG_TIME_PDI = 0x0410
    WATCHDOG_TIME = 0x0420
    WATCHDOG_STATUS = 0x0440
    EEPROM_CONTROL = 0x0502
    EEPROM_DATA = 0x0508
    FMMU = 0x0600
    SYNC_MANAGER = 0x0800
    PROCESS_RAM = 0x1000


FMMU_BYTES, SYNC_MANAGER_BYTES = 16, 8


class AlState(IntEnum):
    """States of a slave's application layer."""

    INIT = 1
    PREOP = 2
    BOOT = 3
    SAFEOP = 4
    OP = 8


AL_STATE_MASK, AL_ERROR = 0x0F, 0x10
"""In the AL status, bit 4 reports an error; in the AL control, it acknowledges one."""

DEVICE_EMULATION = 0x01
"""Bit of :attr:`Register.ESC_CONFIGURATION`: there is no processor, and AL control is copied into AL status, including
bit 4.
"""


class AlCode(IntEnum):
    """Why a slave refused or left a state."""

    NONE = 0x0000
    UNSPECIFIED = 0x0001
    NO_MEMORY = 0x0002
    INVALID_STATE_CHANGE = 0x0011
    UNKNOWN_STATE = 0x0012
    BOOT_NOT_SUPPORTED = 0x0013
    NO_VALID_FIRMWARE = 0x0014
    INVALID_MAILBOX_BOOT = 0x0015
    INVALID_MAILBOX_PREOP = 0x0016
    INVALID_SYNC_MANAGER = 0x0017
    NO_VALID_INPUTS = 0x0018
    NO_VALID_OUTPUTS = 0x0019
    SYNCHRONISATION = 0x001A
    WATCHDOG = 0x001B
    INVALID_SYNC_MANAGER_TYPES = 0x001C
    INVALID_OUTPUTS = 0x001D
    INVALID_INPUTS = 0x001E
    INVALID_WATCHDOG = 0x001F
    NEEDS_COLD_START = 0x0020
    NEEDS_INIT = 0x0021
    NEEDS_PREOP = 0x0022
    NEEDS_SAFEOP = 0x0023
    INVALID_INPUT_MAPPING = 0x0024
    INVALID_OUTPUT_MAPPING = 0x0025
    SETTINGS_CONFLICT = 0x0026
    EEPROM_NO_ACCESS = 0x0050
    EEPROM_ERROR = 0x0051


_CODE_WORDS = {
    AlCode.NONE: "no reason given",
    AlCode.UNSPECIFIED: "no reason given",
    AlCode.NO_MEMORY: "out of memory",
    AlCode.INVALID_STATE_CHANGE: "the requested change of state is not allowed",
    AlCode.UNKNOWN_STATE: "the requested state does not exist",
    AlCode.BOOT_NOT_SUPPORTED: "has no bootstrap state",
    AlCode.NO_VALID_FIRMWARE: "has no valid firmware",
    AlCode.INVALID_MAILBOX_BOOT: "mailbox set up wrongly for bootstrap",
    AlCode.INVALID_MAILBOX_PREOP: "mailbox set up wrongly",
    AlCode.INVALID_SYNC_MANAGER: "SyncManagers set up wrongly",
    AlCode.NO_VALID_INPUTS: "has no valid inputs",
    AlCode.NO_VALID_OUTPUTS: "received no valid outputs",
    AlCode.SYNCHRONISATION: "lost synchronisation",
    AlCode.WATCHDOG: "watchdog: no process data arrived in time",
    AlCode.INVALID_SYNC_MANAGER_TYPES: "SyncManager types are wrong",
    AlCode.INVALID_OUTPUTS: "output SyncManagers have a wrong address or length",
    AlCode.INVALID_INPUTS: "input SyncManagers have a wrong address or length",
    AlCode.INVALID_WATCHDOG: "watchdog set up wrongly",
    AlCode.NEEDS_COLD_START: "needs a power cycle",
    AlCode.NEEDS_INIT: "must go through INIT",
    AlCode.NEEDS_PREOP: "must go through PREOP",
    AlCode.NEEDS_SAFEOP: "must go through SAFEOP",
    AlCode.INVALID_INPUT_MAPPING: "invalid input mapping",
    AlCode.INVALID_OUTPUT_MAPPING: "invalid output mapping",
    AlCode.SETTINGS_CONFLICT: "settings contradict each other",
    AlCode.EEPROM_NO_ACCESS: "cannot reach its EEPROM",
    AlCode.EEPROM_ERROR: "its EEPROM is faulty",
}


@dataclass(frozen=True)
class AlStatus:
    """What a slave says of its state.

    Attributes:
        state: the state word without its error bit; a healthy slave shows one of :class:`AlState`.
        error: the slave refused a request or left a state by itself.
        code: the reason, see :class:`AlCode`; 0 if there is none.
    """

    state: int
    error: bool = False
    code: int = 0

    SIZE = 6

    @classmethod
    def decode(cls, data: bytes) -> AlStatus:
        """Read the six bytes at :attr:`Register.AL_STATUS`.

        Raises:
            CodecError: another number of bytes.
        """
        if len(data) != cls.SIZE:
            raise CodecError(f"an AL status of {len(data)} bytes", where="EtherCAT slave")
        status, code = struct.unpack("<H2xH", data)
        return cls(status & AL_STATE_MASK, bool(status & AL_ERROR), code)

    def encode(self) -> bytes:
        """The six bytes of the register block."""
        return struct.pack("<H2xH", self.state | (AL_ERROR if self.error else 0), self.code)

    def __str__(self) -> str:
        """For people: ``SAFEOP with error 0x001B, watchdog: no process data arrived in time``."""
        state = AlState(self.state).name if self.state in set(AlState) else f"unknown state {self.state}"
        if not self.error and not self.code:
            return state
        words = _CODE_WORDS[AlCode(self.code)] if self.code in _CODE_WORDS else "a code without published meaning"
        return f"{state} with error 0x{self.code:04X}, {words}"


@dataclass(frozen=True)
class SyncManager:
    """A one-buffer SyncManager: guards a block of process memory between master and slave application.

    A write by the master is refused until the application has read the previous one; a read is refused until the
    application has written.

    Attributes:
        start, length: the block.
        to_slave: whether the master writes it.
        watched: whether a write by the master resets the slave's process data watchdog.
    """

    start: int
    length: int
    to_slave: bool
    watched: bool = False

    def encode(self) -> bytes:
        """The eight register bytes that enable it, as Shadow's master writes them (including the status byte)."""
        control = 0x02 | (0x24 if self.to_slave else 0x00) | (0x40 if self.watched else 0x00)
        return struct.pack("<HHBBH", self.start, self.length, control, int(self.to_slave), 1)


@dataclass(frozen=True)
class Fmmu:
    """Maps whole bytes of the logical process image to a slave's memory.

    Attributes:
        logical: first address in the image.
        length: bytes.
        physical: first address in the slave.
        to_slave: whether the master writes these bytes; otherwise it reads them.
    """

    logical: int
    length: int
    physical: int
    to_slave: bool

    def encode(self) -> bytes:
        """The sixteen register bytes that enable it."""
        kind = 2 if self.to_slave else 1
        return struct.pack("<IHBBHBBBxxx", self.logical, self.length, 0, 7, self.physical, 0, kind, 1)
