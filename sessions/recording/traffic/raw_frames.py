"""A transport's message as stored in a traffic file: its bytes and stamps.

The format is ROS 2 CDR, so that any MCAP reader with a CDR decoder can read the fields. Devices that number or stamp
their messages do so inside the bytes; a :data:`Stamper` extracts that without decoding the rest, so that a gap shows
even if the message cannot be decoded.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from drivers.core.clock import NANOSECONDS

SCHEMA_NAME = "tactile_lab/msg/RawFrame"
SCHEMA_ENCODING, MESSAGE_ENCODING = "ros2msg", "cdr"
NOT_GIVEN = 0xFFFF_FFFF_FFFF_FFFF

DEFINITION = """\
# One message of a device's transport, as it was on the wire.
builtin_interfaces/Time stamp   # reception or sending, session clock
uint64 device_counter           # the device's own number of it; 18446744073709551615: it has none
uint64 device_clock_ns          # the device's own time of it; 18446744073709551615: it has none
uint8[] data
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""

_LITTLE_ENDIAN_CDR = b"\x00\x01\x00\x00"
_HEAD = struct.Struct("<4sIIQQI")
_SECONDS_MASK = 0x7FFF_FFFF


@dataclass(frozen=True)
class DeviceStamp:
    """A device's own stamp of a message.

    Attributes:
        counter: its own number of the (first) reading in the message, or None.
        clock_ns: its own time, or None.
        readings: how many consecutive numbers the message covers.
    """

    counter: int | None = None
    clock_ns: int | None = None
    readings: int = 1


UNSTAMPED = DeviceStamp()

Stamper: TypeAlias = Callable[[bytes], DeviceStamp]
"""Reads a device's own stamp from a message; never raises, whatever the bytes are."""


def encode(payload: bytes, stamp_ns: int, device: DeviceStamp = UNSTAMPED) -> bytes:
    """A message as stored in the file."""
    seconds, nanoseconds = divmod(stamp_ns, NANOSECONDS)
    counter = NOT_GIVEN if device.counter is None else device.counter
    clock_ns = NOT_GIVEN if device.clock_ns is None else device.clock_ns
    head = _HEAD.pack(_LITTLE_ENDIAN_CDR, seconds & _SECONDS_MASK, nanoseconds, counter, clock_ns, len(payload))
    return head + payload


def decode(data: bytes) -> tuple[bytes, DeviceStamp]:
    """The bytes on the wire, and the device's own stamp.

    Raises:
        ValueError: not a message of this format.
    """
    if len(data) < _HEAD.size:
        raise ValueError(f"a raw frame has at least {_HEAD.size} bytes, not {len(data)}")
    form, _, _, counter, clock_ns, size = _HEAD.unpack_from(data)
    if form != _LITTLE_ENDIAN_CDR or size != len(data) - _HEAD.size:
        raise ValueError("not a raw frame")
    return data[_HEAD.size :], DeviceStamp(
        None if counter == NOT_GIVEN else counter, None if clock_ns == NOT_GIVEN else clock_ns
    )
