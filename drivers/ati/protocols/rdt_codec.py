"""RDT, the real-time protocol of ATI's Net F/T box: UDP port 49152, big-endian, one client at a time.

A request has 8 bytes and a record 36; a datagram holds one or more records (protocols: Net F/T). Counts become newtons
and newton metres by the box's counts per force and counts per torque.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.core.errors import CodecError

PORT = 49152
HEADER = 0x1234
RECORD = np.dtype([("rdt_sequence", ">u4"), ("ft_sequence", ">u4"), ("status", ">u4"), ("counts", ">i4", (6,))])
"""One record: force x, y, z then torque x, y, z in counts."""

_RECORD = struct.Struct(">III6i")
_REQUEST = struct.Struct(">HHI")
SATURATION = 1 << 17
_SUMMARY = 1 << 31


class Command(IntEnum):
    """The requests that the box understands."""

    STOP = 0
    START = 2
    START_BUFFERED = 3
    START_MULTI_UNIT = 4
    CLEAR_CONDITION_LATCH = 0x41
    SET_SOFTWARE_BIAS = 0x42


@dataclass(frozen=True)
class Request:
    """A decoded request; ``count`` is the number of records wanted, 0 for an endless stream."""

    command: Command
    count: int


class Severity(IntEnum):
    """How bad a status word is: a warning leaves the reading usable, a fault does not."""

    OK = 0
    WARNING = 1
    FAULT = 2


@dataclass(frozen=True)
class StatusReport:
    """A decoded status word."""

    severity: Severity
    messages: tuple[str, ...]


_MEANING: dict[int, tuple[Severity, str]] = {
    30: (Severity.FAULT, "processor or memory failure"),
    29: (Severity.FAULT, "digital board failure"),
    28: (Severity.FAULT, "analog board failure"),
    27: (Severity.FAULT, "serial link between the boards failed"),
    26: (Severity.FAULT, "program memory failure"),
    25: (Severity.FAULT, "halted by a configuration error"),
    24: (Severity.WARNING, "settings checksum wrong"),
    23: (Severity.FAULT, "configuration does not fit the calibration"),
    22: (Severity.WARNING, "network failure"),
    21: (Severity.WARNING, "CAN failure"),
    20: (Severity.WARNING, "RDT failure"),
    19: (Severity.WARNING, "EtherNet/IP failure"),
    18: (Severity.WARNING, "DeviceNet failure"),
    17: (Severity.FAULT, "sensor saturated or disconnected"),
    16: (Severity.WARNING, "a monitor condition is latched"),
    14: (Severity.FAULT, "watchdog reset"),
    13: (Severity.FAULT, "stack failure"),
    12: (Severity.FAULT, "EEPROM failure on the serial link"),
    11: (Severity.FAULT, "flash memory failure"),
    10: (Severity.FAULT, "analog board watchdog reset"),
    9: (Severity.FAULT, "strain gauge excitation too high"),
    8: (Severity.FAULT, "strain gauge excitation too low"),
    7: (Severity.FAULT, "analog ground out of range"),
    6: (Severity.FAULT, "supply voltage too high"),
    5: (Severity.FAULT, "supply voltage too low"),
    4: (Severity.FAULT, "no data from the analog board"),
    3: (Severity.FAULT, "reference voltage out of range"),
    2: (Severity.WARNING, "internal temperature out of range"),
    1: (Severity.WARNING, "HTTP failure"),
}


def encode_request(command: Command, count: int = 0) -> bytes:
    """The 8 bytes of a request.

    Raises:
        CodecError: ``count`` does not fit 32 bits.
    """
    if not 0 <= count < 1 << 32:
        raise CodecError(f"sample count {count} does not fit 32 bits", where="RDT request")
    return _REQUEST.pack(HEADER, command, count)


def decode_request(payload: bytes) -> Request:
    """Decode a client's request; for emulators.

    Raises:
        CodecError: wrong length, header or command.
    """
    if len(payload) != _REQUEST.size:
        raise CodecError(f"{len(payload)} bytes instead of the {_REQUEST.size} of a request", where="RDT request")
    header, command, count = _REQUEST.unpack(payload)
    if header != HEADER:
        raise CodecError(f"header 0x{header:04x} is not 0x{HEADER:04x}", where="RDT request")
    try:
        return Request(Command(command), count)
    except ValueError as error:
        raise CodecError(f"unknown command 0x{command:x}", where="RDT request") from error


def records(payload: bytes) -> Iterator[tuple[int, ...]]:
    """The records of one datagram as Python integers: RDT sequence, FT sequence, status and six counts each.

    For datagrams with few records this is several times faster than an array of :data:`RECORD`.

    Raises:
        CodecError: the length is not a whole number of records.
    """
    _check_length(payload)
    return _RECORD.iter_unpack(payload)


def holds_records(payload: bytes) -> bool:
    """Whether a datagram has the length of one or more whole records."""
    return bool(payload) and not len(payload) % RECORD.itemsize


def _check_length(payload: bytes) -> None:
    if not holds_records(payload):
        raise CodecError(
            f"{len(payload)} bytes are not a whole number of {RECORD.itemsize}-byte records",
            where="RDT record",
            hint="Check that this port receives from the force sensor's box only",
        )


def encode_record(rdt_sequence: int, ft_sequence: int, status: int, counts: Sequence[int]) -> bytes:
    """One record, for emulators; the counters wrap at 2^32.

    Raises:
        CodecError: not six counts, or one that does not fit 32 bits.
    """
    try:
        return _RECORD.pack(rdt_sequence & 0xFFFFFFFF, ft_sequence & 0xFFFFFFFF, status & 0xFFFFFFFF, *counts)
    except struct.error as error:
        raise CodecError(f"counts {counts} do not fit a record", where="RDT record") from error


def encode_records(
    rdt_sequence: NDArray[Any], ft_sequence: NDArray[Any], status: NDArray[Any], counts: NDArray[Any]
) -> bytes:
    """Encode records, for emulators. Sequences and status have shape (n,), counts (n, 6); sequences wrap at 2^32.

    Raises:
        CodecError: the shapes do not agree, or a count does not fit 32 bits.
    """
    rows = np.atleast_2d(np.asarray(counts))
    if rows.ndim != 2 or rows.shape[1] != 6:
        raise CodecError(f"counts of shape {rows.shape} instead of (n, 6)", where="RDT record")
    if (np.abs(rows.astype(np.float64)) > 2**31 - 1).any():
        raise CodecError("a count does not fit 32 bits", where="RDT record")
    columns = [np.asarray(words, np.int64) & 0xFFFFFFFF for words in (rdt_sequence, ft_sequence, status)]
    if any(words.shape != (len(rows),) for words in columns):
        raise CodecError(f"sequences or status not one for each of {len(rows)} records", where="RDT record")
    words = zip(*(words.tolist() for words in columns), rows.astype(np.int64).tolist(), strict=True)
    return b"".join(_RECORD.pack(rdt, ft, state, *counts) for rdt, ft, state, counts in words)


def judge_status(status: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The faults in a status word, which invalidate a reading, and the warnings, which do not; in plain English."""
    report = describe_status(status)
    return (report.messages, ()) if report.severity is Severity.FAULT else ((), report.messages)


def describe_status(status: int) -> StatusReport:
    """A status word in plain English, most severe problem first; 0 is healthy."""
    known = [meaning for bit, meaning in _MEANING.items() if status >> bit & 1]
    messages = [text for _, text in sorted(known, key=lambda item: -item[0])]
    severity = max((level for level, _ in known), default=Severity.OK)
    if unnamed := status & ~_SUMMARY & ~sum(1 << bit for bit in _MEANING):
        messages.append(f"undocumented status bits 0x{unnamed:08x}")
        severity = max(severity, Severity.WARNING)
    if status & _SUMMARY and not messages:
        messages.append("the box reports an error without naming it")
        severity = Severity.FAULT
    return StatusReport(severity, tuple(messages))
