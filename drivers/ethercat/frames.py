"""EtherCAT frames: an Ethernet header, and telegrams that every slave reads and changes while the frame passes through.

Layout after the EtherCAT standard (IEC 61158-4-12; protocols: EtherCAT frames): EtherType 0x88A4, a length word with
the type in its upper four bits, then telegrams, each with a ten-byte header, data and a working counter. All but the
Ethernet header is little-endian.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from drivers.core.errors import CodecError

ETHERTYPE = 0x88A4
BROADCAST = b"\xff" * 6
SHORTEST_FRAME = 60
LARGEST_DATA = 1486
"""Data bytes that fit a frame with a single telegram."""

_ETHERNET = struct.Struct(">6s6sH")
_LENGTH = struct.Struct("<H")
_HEAD = struct.Struct("<BBIHH")
_COUNTER = struct.Struct("<H")
_TELEGRAM_TYPE = 1
_OVERHEAD = _HEAD.size + _COUNTER.size
_MORE, _LENGTH_MASK, _CIRCULATED = 0x8000, 0x07FF, 0x4000


class Command(IntEnum):
    """What slaves do with a telegram. AP: by position, FP: by station address, B: all, L: by logical address."""

    NOP = 0
    APRD = 1
    APWR = 2
    APRW = 3
    FPRD = 4
    FPWR = 5
    FPRW = 6
    BRD = 7
    BWR = 8
    BRW = 9
    LRD = 10
    LWR = 11
    LRW = 12
    ARMW = 13
    FRMW = 14


@dataclass(frozen=True)
class Telegram:
    """One telegram.

    Attributes:
        command: what to do.
        address: 32 bits; logical, or slave in the lower and register in the upper half (see :func:`physical`).
        data: the bytes to write, or space for the bytes that are read.
        index: chosen by the master; returned unchanged.
        working_counter: incremented by each slave: by 1 for a read, 1 for a write, 3 for both in one telegram.
        interrupt: event bits the slaves may set.
        circulated: the frame has already gone round a broken ring once.
    """

    command: Command
    address: int
    data: bytes
    index: int = 0
    working_counter: int = 0
    interrupt: int = 0
    circulated: bool = False

    @property
    def slave(self) -> int:
        """Position or station address of a telegram that is not logical."""
        return self.address & 0xFFFF

    @property
    def register(self) -> int:
        """Register address of a telegram that is not logical."""
        return self.address >> 16

    def answers(self, request: Telegram) -> bool:
        """Whether this can be the answer to a request: slaves change only position, data and counter."""
        return (
            self.command == request.command
            and self.index == request.index
            and self.address >> 16 == request.address >> 16
            and len(self.data) == len(request.data)
        )


def physical(slave: int, register: int) -> int:
    """Address of a register of one slave, by its position (negative, from 0 down) or its station address."""
    return slave & 0xFFFF | register << 16


def encode_frame(telegrams: Sequence[Telegram], source: bytes) -> bytes:
    """Encode telegrams as a broadcast Ethernet frame, without its check sequence.

    Args:
        telegrams: at least one.
        source: six bytes of the sender's hardware address.

    Raises:
        CodecError: there is nothing to send, a value does not fit its field, or the telegrams do not fit a frame.
    """
    if not telegrams:
        raise CodecError("a frame without telegrams", where="EtherCAT frame")
    last = len(telegrams) - 1
    body = b"".join(_encode(telegram, more=place < last) for place, telegram in enumerate(telegrams))
    if len(body) > LARGEST_DATA + _OVERHEAD:
        raise CodecError(f"{len(body)} bytes of telegrams do not fit a frame", where="EtherCAT frame")
    head = _ETHERNET.pack(BROADCAST, source, ETHERTYPE) + _LENGTH.pack(_TELEGRAM_TYPE << 12 | len(body))
    return (head + body).ljust(SHORTEST_FRAME, b"\0")


def _encode(telegram: Telegram, *, more: bool) -> bytes:
    size = len(telegram.data)
    if size > LARGEST_DATA:
        raise CodecError(f"a telegram of {size} data bytes does not fit a frame", where="EtherCAT frame")
    flags = size | (_MORE if more else 0) | (_CIRCULATED if telegram.circulated else 0)
    try:
        head = _HEAD.pack(telegram.command, telegram.index, telegram.address, flags, telegram.interrupt)
        return head + telegram.data + _COUNTER.pack(telegram.working_counter)
    except struct.error as error:
        raise CodecError(f"a value does not fit its field ({error})", where="EtherCAT frame") from error


def source_of(frame: bytes) -> bytes:
    """The six source bytes of an Ethernet frame; fewer if the frame is shorter."""
    return frame[6:12]


def decode_frame(frame: bytes) -> tuple[Telegram, ...]:
    """The telegrams of an Ethernet frame, at least one; padding is ignored.

    Raises:
        CodecError: it is not an EtherCAT frame of telegrams, or it is damaged.
    """
    if len(frame) < _ETHERNET.size + _LENGTH.size:
        raise CodecError(f"a frame of {len(frame)} bytes", where="EtherCAT frame")
    _, _, ethertype = _ETHERNET.unpack_from(frame)
    (length,) = _LENGTH.unpack_from(frame, _ETHERNET.size)
    if ethertype != ETHERTYPE or length >> 12 != _TELEGRAM_TYPE:
        raise CodecError(f"EtherType 0x{ethertype:04X}, type {length >> 12}", where="EtherCAT frame")
    start = _ETHERNET.size + _LENGTH.size
    end = start + (length & _LENGTH_MASK)
    if end > len(frame):
        raise CodecError(f"{end - len(frame)} bytes shorter than its stated length", where="EtherCAT frame")
    return _decode_telegrams(frame, start, end)


def _decode_telegrams(frame: bytes, at: int, end: int) -> tuple[Telegram, ...]:
    telegrams, more = [], True
    while more:
        if at + _OVERHEAD > end:
            raise CodecError("a telegram is truncated", where="EtherCAT frame")
        command, index, address, flags, interrupt = _HEAD.unpack_from(frame, at)
        data_at, size, more = at + _HEAD.size, flags & _LENGTH_MASK, bool(flags & _MORE)
        at = data_at + size + _COUNTER.size
        if at > end:
            raise CodecError("a telegram is truncated", where="EtherCAT frame")
        (counter,) = _COUNTER.unpack_from(frame, data_at + size)
        data, circulated = frame[data_at : data_at + size], bool(flags & _CIRCULATED)
        telegrams.append(Telegram(_known_command(command), address, data, index, counter, interrupt, circulated))
    return tuple(telegrams)


def _known_command(command: int) -> Command:
    try:
        return Command(command)
    except ValueError:
        raise CodecError(f"unknown command {command}", where="EtherCAT frame") from None
