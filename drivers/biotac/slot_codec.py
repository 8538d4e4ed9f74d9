"""A BioTac's 16 bytes inside the palm's status (protocols: BioTac slots).

Each request returns two values, that of the requested channel and that of the next channel in order, plus two readings
of the vibration channel. The status says which request a slot answers; the slot itself does not.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

from drivers.core.errors import CodecError

SLOT_BYTES = 16
SLOTS = 5
PALM_SLOT_BYTES = (16, 32)
"""Bytes that a palm reserves for each fingertip; a palm 0230 reserves twice as many and puts the BioTac's data
first.
"""
LARGEST_COUNT = 4095
"""Every channel is read by a 12-bit converter."""

_SLOT = struct.Struct("<HHHBxH6x")
_PAC0, _PAC1, _FIRST, _SECOND = 1, 2, 4, 8


class Channel(IntEnum):
    """The channels of a BioTac; electrodes n = 1 to 24 follow as 3 + n."""

    PDC = 1
    TAC = 2
    TDC = 3


LAST_CHANNEL = 27


def electrode_channel(number: int) -> int:
    """Channel of an electrode, 1 to 24."""
    return Channel.TDC + number


@dataclass(frozen=True)
class Slot:
    """One decoded slot.

    Attributes:
        vibration: the valid readings of the vibration channel (PAC), at most two, oldest first, counts.
        values: the other valid readings by channel, counts.
    """

    vibration: tuple[int, ...]
    values: Mapping[int, int]


def decode_slot(payload: bytes, request: int) -> Slot:
    """Decode one slot of 16 bytes, the answer to ``request``.

    Readings outside the converter's range are returned unchanged: a socket without a sensor shows such values. Answers
    to other requests than those for channels, such as the name, hold no readings.

    Raises:
        CodecError: wrong length.
    """
    if len(payload) != SLOT_BYTES:
        raise CodecError(f"{len(payload)} bytes instead of the {SLOT_BYTES} of a slot", where="BioTac slot")
    if request > LAST_CHANNEL:
        return Slot((), {})
    pac0, pac1, first, valid, second = _SLOT.unpack(payload)
    values: dict[int, int] = {}
    if valid & _FIRST and request >= Channel.PDC:
        values[request] = first
    if valid & _SECOND and Channel.PDC <= request < LAST_CHANNEL:
        values[request + 1] = second
    vibration = [pac for pac, bit in ((pac0, _PAC0), (pac1, _PAC1)) if valid & bit]
    return Slot(tuple(vibration), values)


def encode_slot(slot: Slot, request: int) -> bytes:
    """The bytes of a slot, for emulators.

    Raises:
        CodecError: a reading does not fit 16 bits, or more than two vibration readings.
    """
    pacs, first, second = slot.vibration, slot.values.get(request), slot.values.get(request + 1)
    if len(pacs) > 2:
        raise CodecError(f"{len(pacs)} vibration readings instead of the two of a slot", where="BioTac slot")
    valid = (_PAC0 | _PAC1) >> (2 - len(pacs)) if pacs else 0
    valid |= (_FIRST if first is not None else 0) | (_SECOND if second is not None else 0)
    padded = (*pacs, 0, 0)
    try:
        return _SLOT.pack(padded[0], padded[1], first or 0, valid, second or 0)
    except struct.error as error:
        raise CodecError("a reading does not fit 16 bits", where="BioTac slot") from error
