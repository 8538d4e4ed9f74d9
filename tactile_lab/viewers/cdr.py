"""Two of ROS 2's messages in CDR, for which Foxglove has no type of its own; with their definitions."""

from __future__ import annotations

import struct

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import Array

_HEAD = b"\x00\x01\x00\x00"
"""Little-endian CDR without options."""

STRING = "string data\n"

_RULE = "=" * 80
WRENCH_STAMPED = f"""std_msgs/Header header
geometry_msgs/Wrench wrench
{_RULE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_RULE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
{_RULE}
MSG: geometry_msgs/Wrench
geometry_msgs/Vector3 force
geometry_msgs/Vector3 torque
{_RULE}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""


def string(text: str) -> bytes:
    """A ``std_msgs/msg/String``."""
    return _HEAD + _text(text)


def wrench_stamped(stamp_ns: int, frame: str, force_N: Array, torque_Nm: Array) -> bytes:
    """A ``geometry_msgs/msg/WrenchStamped``: force and torque of shape (3,), in the frame."""
    head = struct.pack("<iI", stamp_ns // NANOSECONDS, stamp_ns % NANOSECONDS) + _text(frame)
    padding = b"\x00" * (-len(head) % 8)
    return _HEAD + head + padding + struct.pack("<6d", *force_N, *torque_Nm)


def _text(text: str) -> bytes:
    content = text.encode() + b"\x00"
    return struct.pack("<I", len(content)) + content
