"""Reads a device's counter and clock from its messages, without decoding the rest."""

from __future__ import annotations

import struct

from drivers.camera.packet import counter_of
from drivers.core.registry import Registry
from sessions.recording.traffic.raw_frames import UNSTAMPED, DeviceStamp, Stamper

RDT_RECORD_BYTES = 36
RDT_CLOCK_ns = 1_000_000_000 // 7000
"""A Net F/T box counts its measurements at 7 kHz (protocols: Net F/T)."""

_RDT_HEAD = struct.Struct(">II")
_POSITIONER_HEAD = struct.Struct("<I")
POSITIONER_STATUS_BYTES = 52


def rdt_stamp(payload: bytes) -> DeviceStamp:
    """RDT records of a Net F/T box: number of the first one sent, and the box's count of measurements as time."""
    if not payload or len(payload) % RDT_RECORD_BYTES:
        return UNSTAMPED
    sent, measured = _RDT_HEAD.unpack_from(payload)
    return DeviceStamp(sent, measured * RDT_CLOCK_ns, len(payload) // RDT_RECORD_BYTES)


def camera_stamp(payload: bytes) -> DeviceStamp:
    """A packet of the camera: the number of its frame, which counts lost frames too; a picture
    without header has none.
    """
    return DeviceStamp(counter_of(payload))


def positioner_stamp(payload: bytes) -> DeviceStamp:
    """A status of the positioner, an arm's too: the number of the command it answers."""
    if len(payload) < POSITIONER_STATUS_BYTES:
        return UNSTAMPED
    return DeviceStamp(_POSITIONER_HEAD.unpack_from(payload)[0])


STAMPERS: Registry[Stamper] = Registry("stamper", group="stampers")
"""Readers of a device's counter and clock; most devices have none. By wire name, on a simulated rig by kind.
"""

STAMPERS.register("net-ft", rdt_stamp)
STAMPERS.register("nano17", rdt_stamp)  # simulated ones send as behind a Net F/T box
STAMPERS.register("six-axis", positioner_stamp)
STAMPERS.register("ur", positioner_stamp)
