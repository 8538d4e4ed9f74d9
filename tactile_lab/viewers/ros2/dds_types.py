"""ROS 2's types as Cyclone DDS needs them, made of the definitions that ``rosbags`` has.

Names follow ROS 2's mapping to DDS: the topic ``/tf`` is ``rt/tf``, its type ``tf2_msgs::msg::dds_::TFMessage_``, and a
service is a topic of requests (``rq/``) and one of replies (``rr/``).
"""

from __future__ import annotations

from functools import cache
from typing import Any

from cyclonedds.idl import make_idl_struct, types
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

_NUMBERS = {
    "bool": bool,
    "byte": types.byte,
    "char": types.uint8,
    "octet": types.byte,
    **{name: getattr(types, name) for name in ("float32", "float64")},
    **{f"{sign}int{bits}": getattr(types, f"{sign}int{bits}") for sign in ("", "u") for bits in (8, 16, 32, 64)},
}


@cache
def store() -> Any:
    """Types of a current distribution of ROS 2."""
    return get_typestore(Stores.ROS2_JAZZY)


@cache
def message_type(kind: str) -> Any:
    """The DDS type of a message type such as ``std_msgs/msg/String``."""
    fields = {name: _field(told) for name, told in store().get_msgdef(kind).fields}
    return make_idl_struct(kind.rpartition("/")[2] + "_", dds_name(kind), fields)


def type_hash(kind: str) -> str:
    """By which ROS 2 sees that two sides mean the same type."""
    return str(store().hash_rihs01(kind))


def dds_name(kind: str) -> str:
    """``std_msgs/msg/String`` as ``std_msgs.msg.dds_.String_``; Cyclone's Python writes dots for colons."""
    package, group, name = kind.split("/")
    return f"{package}.{group}.dds_.{name}_"


_HEADER = {"client": types.uint64, "number": types.int64}
"""Before each request and reply, as ``rmw_cyclonedds`` has it: who asks, and which of its requests it is."""

TriggerRequest = make_idl_struct(
    "Trigger_Request_", dds_name("std_srvs/srv/Trigger_Request"), {**_HEADER, "nothing": types.uint8}
)
TriggerReply = make_idl_struct(
    "Trigger_Response_", dds_name("std_srvs/srv/Trigger_Response"), {**_HEADER, "success": bool, "message": str}
)


def _field(told: Any) -> Any:
    """The type of a field, as ``rosbags`` describes it."""
    sort, content = told
    if sort == Nodetype.BASE:
        name = content[0]
        return str if name == "string" else _NUMBERS[name]
    if sort == Nodetype.NAME:
        return message_type(content)
    inner, size = content
    return types.array[_field(inner), size] if sort == Nodetype.ARRAY else types.sequence[_field(inner)]
