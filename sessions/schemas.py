"""Topics of a traffic file, their JSON schemas, and how values are written in them.

Schemas whose names begin with ``foxglove.`` follow Foxglove's published field names, so that standard viewers show
images, poses, transforms and the log without a plug-in. Raw bytes and marks have none.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from gtsam import Pose3

from tactile_lab.clock import NANOSECONDS
from tactile_lab.geometry.contacts import Array, Contact

Json = dict[str, Any]

RAW_ENCODING = "application/octet-stream"
MARKS_TOPIC = "/marks"
JOINTS_TOPIC = "/hand/joints"
LOADS_TOPIC = "/hand/loads"
TRANSFORMS_TOPIC = "/tf"
CONTACTS_TOPIC = "/contacts"
EVENTS_TOPIC = "/events"
IMAGE_TOPIC = "/camera/image"
SLAM_POSE_TOPIC = "/slam/pose"
SLAM_STATE_TOPIC = "/slam/state"
TRUTH_POSE_TOPIC = "/truth/object"
TRUTH_CONTACTS_TOPIC = "/truth/contacts"


@dataclass(frozen=True)
class Schema:
    """A named JSON schema."""

    name: str
    definition: Json

    def to_bytes(self) -> bytes:
        """The schema as JSON text."""
        return json.dumps({"title": self.name, **self.definition}).encode()


def _fields(**properties: Json) -> Json:
    return {"type": "object", "properties": properties}


def _list_of(items: Json) -> Json:
    return {"type": "array", "items": items}


_NUMBER, _INTEGER, _TEXT = {"type": "number"}, {"type": "integer"}, {"type": "string"}
_TIME = _fields(sec=_INTEGER, nsec=_INTEGER)
_VECTOR = _fields(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION = _fields(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_POSE = _fields(position=_VECTOR, orientation=_QUATERNION)
_TRANSFORM = _fields(
    timestamp=_TIME, parent_frame_id=_TEXT, child_frame_id=_TEXT, translation=_VECTOR, rotation=_QUATERNION
)
_POSE_IN_FRAME = Schema("foxglove.PoseInFrame", _fields(timestamp=_TIME, frame_id=_TEXT, pose=_POSE))
_CONTACT = _fields(
    finger=_TEXT,
    point_world_m=_list_of(_NUMBER),
    normal_world=_list_of(_NUMBER),
    point_covariance_m2=_list_of(_list_of(_NUMBER)),
    normal_sigma_rad=_NUMBER,
    force_N=_NUMBER,
)
_FREE = {"type": "object"}

SCHEMAS: Mapping[str, Schema] = {
    JOINTS_TOPIC: Schema("tactile_lab.Joints", _fields(timestamp=_TIME, joints_rad=_FREE, base=_FREE)),
    LOADS_TOPIC: Schema("tactile_lab.Loads", _fields(timestamp=_TIME, load_N=_FREE)),
    TRANSFORMS_TOPIC: Schema("foxglove.FrameTransforms", _fields(transforms=_list_of(_TRANSFORM))),
    CONTACTS_TOPIC: Schema(
        "tactile_lab.Grasp",
        _fields(timestamp=_TIME, index=_INTEGER, contacts=_list_of(_CONTACT), dropped=_FREE, hand_motion_world=_FREE),
    ),
    EVENTS_TOPIC: Schema(
        "foxglove.Log",
        _fields(timestamp=_TIME, level=_INTEGER, message=_TEXT, name=_TEXT, file=_TEXT, line=_INTEGER),
    ),
    IMAGE_TOPIC: Schema(
        "foxglove.CompressedImage",
        _fields(timestamp=_TIME, frame_id=_TEXT, data={"type": "string", "contentEncoding": "base64"}, format=_TEXT),
    ),
    SLAM_POSE_TOPIC: _POSE_IN_FRAME,
    SLAM_STATE_TOPIC: Schema("tactile_lab.SlamState", _FREE),
    TRUTH_POSE_TOPIC: _POSE_IN_FRAME,
    TRUTH_CONTACTS_TOPIC: Schema("tactile_lab.TruthContacts", _fields(timestamp=_TIME, contacts=_list_of(_FREE))),
}
"""Schema of each topic that has one."""


def received_topic(link: str) -> str:
    """Topic of the bytes that came from a link's device."""
    return f"/link/{link}/rx"


def transmitted_topic(link: str) -> str:
    """Topic of the bytes that went to a link's device."""
    return f"/link/{link}/tx"


def received_link(topic: str) -> str | None:
    """Name of the link whose received bytes a topic carries; None for any other topic."""
    return topic[len("/link/") : -len("/rx")] if topic.startswith("/link/") and topic.endswith("/rx") else None


def time(stamp_ns: int) -> Json:
    """Nanoseconds as Foxglove's seconds and nanoseconds."""
    return {"sec": stamp_ns // NANOSECONDS, "nsec": stamp_ns % NANOSECONDS}


def pose(target_T_source: Pose3) -> Json:
    """A Foxglove pose."""
    return {"position": _vector(target_T_source.translation()), "orientation": _quaternion(target_T_source)}


def pose_in_frame(stamp_ns: int, frame: str, frame_T_object: Pose3) -> Json:
    """A ``foxglove.PoseInFrame``."""
    return {"timestamp": time(stamp_ns), "frame_id": frame, "pose": pose(frame_T_object)}


def transform(stamp_ns: int, parent: str, child: str, parent_T_child: Pose3) -> Json:
    """A ``foxglove.FrameTransform``."""
    return {
        "timestamp": time(stamp_ns),
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": _vector(parent_T_child.translation()),
        "rotation": _quaternion(parent_T_child),
    }


def image(stamp_ns: int, frame: str, encoded: bytes) -> Json:
    """A ``foxglove.CompressedImage`` of JPEG or PNG bytes."""
    kind = "png" if encoded.startswith(b"\x89PNG") else "jpeg"
    data = base64.b64encode(encoded).decode()
    return {"timestamp": time(stamp_ns), "frame_id": frame, "data": data, "format": kind}


def contacts(items: Iterable[Contact]) -> list[Json]:
    """Contacts as plain data."""
    return [
        {
            "finger": contact.finger,
            "point_world_m": contact.point_world_m.tolist(),
            "normal_world": contact.normal_world.tolist(),
            "point_covariance_m2": contact.point_covariance_m2.tolist(),
            "normal_sigma_rad": contact.normal_sigma_rad,
            "force_N": contact.force_N,
        }
        for contact in items
    ]


def encode(content: Json) -> bytes:
    """Compact JSON. Numbers that JSON has no word for (NaN) become null."""
    try:
        return _ENCODER.encode(content).encode()
    except ValueError:
        return json.dumps(_without_nan(content), separators=(",", ":")).encode()


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no JSON form")


_ENCODER = json.JSONEncoder(separators=(",", ":"), allow_nan=False, default=_plain)


def _without_nan(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _vector(vector: Array) -> Json:
    x, y, z = (float(value) for value in vector)
    return {"x": x, "y": y, "z": z}


def _quaternion(target_T_source: Pose3) -> Json:
    rotation: Any = target_T_source.rotation().toQuaternion()
    return {"x": rotation.x(), "y": rotation.y(), "z": rotation.z(), "w": rotation.w()}
