"""How large a palm's process data are by its own account.

Of palm 0250 there are headers of two sizes with one product code, so that the code does not determine the layout
(protocols: Palm 0250). What its EEPROM says of its SyncManagers does; and every palm refuses SyncManagers of another
size.
"""

from __future__ import annotations

from drivers.core.errors import DeviceError
from drivers.ethercat.master import EtherCatMaster, Slave
from drivers.ethercat.registers import AlCode
from drivers.shadow.protocol.palm_images import PalmImage, PalmName

_SEVERAL_LAYOUTS: tuple[PalmName, ...] = ("0250",)
_FIRST_CATEGORY, _SYNC_MANAGERS, _END = 0x40, 41, 0xFFFF
_MOST_CATEGORIES = 32
_ENTRY_WORDS = 4
_COMMANDS, _STATUSES = 3, 4
"""What a SyncManager is for, in its last byte."""

OTHER_SIZE = (AlCode.INVALID_SYNC_MANAGER, AlCode.INVALID_OUTPUTS, AlCode.INVALID_INPUTS)
"""Codes with which a slave refuses SyncManagers of another size."""


def check_size(master: EtherCatMaster, palm: Slave, image: PalmImage) -> None:
    """Refuse a palm whose EEPROM states process data of another size than its image, where one code has several.

    Raises:
        DeviceError: both sizes, and what to do. An EEPROM that states no size passes.
    """
    if image.name not in _SEVERAL_LAYOUTS:
        return
    command_bytes, status_bytes = stated_sizes(master, palm)
    if command_bytes and status_bytes and (command_bytes, status_bytes) != (image.command_bytes, image.status_bytes):
        raise other_size(image, master.where, f"{command_bytes} bytes of command and {status_bytes} of status")


def other_size(image: PalmImage, where: str, stated: str) -> DeviceError:
    """The error of a palm whose process data have another size."""
    what = f"the palm's process data are {stated}; those of palm {image.name} are {image.command_bytes} and"
    hint = "Its firmware has another layout, which nothing here can read: ask Shadow Robot for the one of this palm"
    return DeviceError(f"{what} {image.status_bytes}", where=where, hint=hint)


def stated_sizes(master: EtherCatMaster, slave: Slave) -> tuple[int, int]:
    """Bytes of command and of status that a slave's EEPROM states, both 0 where it does not.

    Raises:
        DeviceError: the EEPROM cannot be read.
    """
    at = _FIRST_CATEGORY
    for _ in range(_MOST_CATEGORIES):
        head = master.read_eeprom(slave, at)
        kind, words = head & 0xFFFF, head >> 16
        if kind == _SYNC_MANAGERS:
            entries = range(at + 2, at + 2 + words - words % _ENTRY_WORDS, _ENTRY_WORDS)
            found = [(master.read_eeprom(slave, entry), master.read_eeprom(slave, entry + 2)) for entry in entries]
            lengths = [(first >> 16, last >> 24) for first, last in found]
            command, status = (
                sum(length for length, use in lengths if use == wanted) for wanted in (_COMMANDS, _STATUSES)
            )
            return command, status
        if kind == _END:
            break
        at += 2 + words
    return 0, 0
