"""A slave's EEPROM: its content (ETG.1000.6, slave information interface), and the registers to read it by."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from drivers.ethercat.registers import Register, SyncManager

_HEADER_BYTES, _END = 0x80, b"\xff\xff"
_LARGEST_ENTRY_BYTES = 31
_BUSY, _REFUSED = 0x8000, 0x2000
_COMMANDS, _READ, _WRITE_OR_RELOAD = 0x0700, 0x0100, 0x0600
_STRINGS, _GENERAL, _FMMUS, _SYNC_MANAGERS, _INPUTS, _OUTPUTS = 10, 30, 40, 41, 50, 51


@dataclass(frozen=True)
class SlaveIdentity:
    """The identity of a slave: the 32-bit words that a master reads first."""

    vendor: int
    product: int
    revision: int = 1
    serial: int = 0


def bare_eeprom(identity: SlaveIdentity, kilobits: int = 16) -> bytes:
    """An EEPROM that holds only the identity, so that a master must already know the slave's process image."""
    return _fill(_header(identity, kilobits) + _END, kilobits)


def mapped_eeprom(
    identity: SlaveIdentity, name: str, sync_managers: Sequence[SyncManager], kilobits: int = 16
) -> bytes:
    """An EEPROM that also describes SyncManagers, FMMUs and process data, so that any master can map the slave."""
    categories = _category(_STRINGS, bytes((1, len(name))) + name.encode()) + _category(_GENERAL, _general())
    if sync_managers:
        categories += _category(_FMMUS, bytes((1, 2)))
        categories += _category(_SYNC_MANAGERS, b"".join(map(_sync_manager, sync_managers)))
    for kind, to_slave in ((_INPUTS, False), (_OUTPUTS, True)):
        body = b"".join(
            _process_data(place, each) for place, each in enumerate(sync_managers) if each.to_slave is to_slave
        )
        categories += _category(kind, body) if body else b""
    return _fill(_header(identity, kilobits) + categories + _END, kilobits)


def _header(identity: SlaveIdentity, kilobits: int) -> bytes:
    header = bytearray(_HEADER_BYTES)
    struct.pack_into("<H", header, 0, 0x0080)
    header[14] = _checksum(header[:14])
    struct.pack_into("<4I", header, 0x10, identity.vendor, identity.product, identity.revision, identity.serial)
    struct.pack_into("<2H", header, 0x7C, kilobits - 1, 1)
    return bytes(header)


def _checksum(data: bytes | bytearray) -> int:
    """CRC-8 of the first seven words: polynomial 0x07, initial value 0xFF."""
    crc = 0xFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ (0x07 if crc & 0x80 else 0)) & 0xFF
    return crc


def _category(kind: int, body: bytes) -> bytes:
    body += b"\0" * (len(body) % 2)
    return struct.pack("<2H", kind, len(body) // 2) + body


def _general() -> bytes:
    return bytes((1, 0, 0, 1)).ljust(32, b"\0")


def _sync_manager(manager: SyncManager) -> bytes:
    start, length, control = struct.unpack("<HHB", manager.encode()[:5])
    return struct.pack("<HHBBBB", start, length, control, 0, 1, 3 if manager.to_slave else 4)


def _process_data(place: int, manager: SyncManager) -> bytes:
    """One process data object that fills a SyncManager, split into entries of whole bytes."""
    sizes = [min(_LARGEST_ENTRY_BYTES, manager.length - at) for at in range(0, manager.length, _LARGEST_ENTRY_BYTES)]
    index = (0x1600 if manager.to_slave else 0x1A00) + place
    head = struct.pack("<HBBBBH", index, len(sizes), place, 0, 0, 0)
    return head + b"".join(
        struct.pack("<HBBBBH", 0x6000 + place, number + 1, 0, 0, 8 * size, 0) for number, size in enumerate(sizes)
    )


def _fill(content: bytes, kilobits: int) -> bytes:
    return content.ljust(kilobits * 128, b"\xff")


class EepromInterface:
    """The registers through which a master reads the EEPROM, four bytes at a time. Writing is not supported.

    Args:
        content: the EEPROM's bytes.
        busy: how often a read of the register shows it busy after each request.
    """

    def __init__(self, content: bytes, busy: int) -> None:
        self._content, self.busy = content, busy
        self._busy_left = 0

    def request(self) -> None:
        """Handle a write of the master to the control register."""
        self._busy_left = self.busy

    def look(self, memory: bytearray) -> None:
        """Update the control register in a slave's memory before the master reads it."""
        control, word = struct.unpack_from("<HI", memory, Register.EEPROM_CONTROL)
        struct.pack_into("<H", memory, Register.EEPROM_CONTROL, self._state(control))
        if not self._busy_left and control & _READ:
            data = self._content[2 * word : 2 * word + 4].ljust(4, b"\xff")
            memory[Register.EEPROM_DATA : Register.EEPROM_DATA + 4] = data
        self._busy_left = max(self._busy_left - 1, 0)

    def _state(self, control: int) -> int:
        if self._busy_left:
            return control & _COMMANDS | _BUSY
        return control & _COMMANDS | _REFUSED if control & _WRITE_OR_RELOAD else 0
