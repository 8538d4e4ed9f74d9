"""Topics of a traffic file, their JSON schemas, and the encoding of values.

Schemas whose names begin with ``foxglove.`` follow Foxglove's published field names, so that standard viewers show
images, poses, transforms, joints, point clouds, scenes and the log without a plug-in; the larger ones are in
:mod:`sessions.recording.traffic.foxglove`. Those that begin with ``tactile_lab.`` are this project's own, described in
``docs/sessions.md``. Bytes of transports have the envelope of :mod:`sessions.recording.traffic.raw_frames`.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Contact
from sessions.recording.traffic import foxglove
from sessions.recording.traffic.foxglove import (
    BYTES,
    INTEGER,
    NUMBER,
    POSE,
    QUATERNION,
    TEXT,
    TIME,
    VECTOR,
    Json,
    fields,
    list_of,
    pose,
    quaternion,
    time,
    vector,
)

RAW_ENCODING = "application/octet-stream"
SESSION_EVENTS_TOPIC = "/marks"
JOINTS_TOPIC = "/hand/joints"
LOADS_TOPIC = "/hand/loads"
TRANSFORMS_TOPIC = "/tf"
CONTACTS_TOPIC = "/contacts"
CLOUD_TOPIC = "/contacts/points"
SCENE_TOPIC = "/contacts/scene"
CAMERA_TOPIC = "/camera/calibration"
LOG_TOPIC = "/events"
STREAMS_TOPIC = "/recorder/streams"
SAFETY_TOPIC = "/safety/stop"
IMAGE_TOPIC = "/camera/image"
SLAM_POSE_TOPIC = "/slam/pose"
SLAM_STATE_TOPIC = "/slam/state"
SLAM_SURFACE_TOPIC = "/slam/surface"
PLAN_TOPIC = "/plan"
GUIDE_TOPIC = "/guide"
DECISION_TOPIC = "/decision"
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


_TRANSFORM = fields(timestamp=TIME, parent_frame_id=TEXT, child_frame_id=TEXT, translation=VECTOR, rotation=QUATERNION)
_POSE_IN_FRAME = Schema("foxglove.PoseInFrame", fields(timestamp=TIME, frame_id=TEXT, pose=POSE))
_CONTACT = fields(
    finger=TEXT,
    point_world_m=list_of(NUMBER),
    normal_world=list_of(NUMBER),
    point_covariance_m2=list_of(list_of(NUMBER)),
    normal_sigma_rad=NUMBER,
    force_N=NUMBER,
)
_FREE = {"type": "object"}
_LIST = list_of(NUMBER)

SCHEMAS: Mapping[str, Schema] = {
    JOINTS_TOPIC: Schema("foxglove.JointStates", foxglove.JOINT_STATES),
    LOADS_TOPIC: Schema("tactile_lab.Loads", fields(timestamp=TIME, load_N=_FREE)),
    TRANSFORMS_TOPIC: Schema("foxglove.FrameTransforms", fields(transforms=list_of(_TRANSFORM))),
    CONTACTS_TOPIC: Schema(
        "tactile_lab.Grasp",
        fields(
            timestamp=TIME,
            index=INTEGER,
            contacts=list_of(_CONTACT),
            dropped=_FREE,
            hand_motion_world=_FREE,
            motion_sigma=_FREE,
        ),
    ),
    CLOUD_TOPIC: Schema("foxglove.PointCloud", foxglove.POINT_CLOUD),
    SCENE_TOPIC: Schema("foxglove.SceneUpdate", foxglove.SCENE_UPDATE),
    CAMERA_TOPIC: Schema("foxglove.CameraCalibration", foxglove.CAMERA_CALIBRATION),
    SAFETY_TOPIC: Schema("tactile_lab.SafetyStop", fields(timestamp=TIME, cause=TEXT, cycles=list_of(_FREE))),
    LOG_TOPIC: Schema(
        "foxglove.Log",
        fields(timestamp=TIME, level=INTEGER, message=TEXT, name=TEXT, file=TEXT, line=INTEGER),
    ),
    IMAGE_TOPIC: Schema(
        "foxglove.CompressedImage",
        fields(timestamp=TIME, frame_id=TEXT, data=BYTES, format=TEXT),
    ),
    SLAM_POSE_TOPIC: _POSE_IN_FRAME,
    SLAM_STATE_TOPIC: Schema("tactile_lab.SlamState", _FREE),
    SLAM_SURFACE_TOPIC: Schema(
        "tactile_lab.Surface",
        fields(timestamp=TIME, vertices_m=list_of(list_of(NUMBER)), faces=list_of(list_of(INTEGER)), sigma_m=_LIST),
    ),
    PLAN_TOPIC: Schema("tactile_lab.Plan", _FREE),
    GUIDE_TOPIC: Schema("tactile_lab.Guide", _FREE),
    DECISION_TOPIC: Schema("tactile_lab.Decision", _FREE),
    STREAMS_TOPIC: Schema("tactile_lab.Streams", fields(timestamp=TIME, streams=_FREE)),
    TRUTH_POSE_TOPIC: _POSE_IN_FRAME,
    TRUTH_CONTACTS_TOPIC: Schema("tactile_lab.TruthContacts", fields(timestamp=TIME, contacts=list_of(_FREE))),
}
"""Schema of each topic that has one."""


_WRENCH = Schema(
    "tactile_lab.Wrench",
    fields(
        timestamp=TIME,
        frame_id=TEXT,
        force_N=list_of(NUMBER),
        torque_Nm=list_of(NUMBER),
        device_counter=INTEGER,
        device_clock=INTEGER,
        status=INTEGER,
    ),
)
_BIOTAC = Schema("tactile_lab.BioTac", fields(timestamp=TIME, finger=TEXT, counts=_FREE, pac=list_of(INTEGER)))


def wrench_topic(finger: str) -> str:
    """Topic of a fingertip's wrenches."""
    return f"/ft/{finger}/wrench"


def biotac_topic(finger: str) -> str:
    """Topic of a BioTac's readings."""
    return f"/biotac/{finger}/readings"


def schema_by_form(topic: str) -> Schema | None:
    """Schema of the topics that exist once per finger."""
    kind = {"wrench": _WRENCH, "readings": _BIOTAC}.get(topic.rpartition("/")[2])
    return kind if topic.startswith(("/ft/", "/biotac/")) else None


def is_raw(topic: str) -> bool:
    """Whether a topic carries the bytes of a transport."""
    return topic.startswith("/link/")


def received_topic(transport: str) -> str:
    """Topic of the bytes received from a transport's device."""
    return f"/link/{transport}/rx"


def transmitted_topic(transport: str) -> str:
    """Topic of the bytes sent to a transport's device."""
    return f"/link/{transport}/tx"


def received_transport(topic: str) -> str | None:
    """Name of the transport whose received bytes a topic carries; None for any other topic."""
    return link_of(topic) if is_raw(topic) and topic.endswith("/rx") else None


@lru_cache(maxsize=64)  # asked for every message
def stamper_of(topic: str) -> str | None:
    """Name of the transport that stamps a topic's messages; None if the program stamps them."""
    return "camera" if topic == IMAGE_TOPIC else received_transport(topic)


def link_of(topic: str) -> str:
    """Name of the transport of a topic that carries bytes."""
    return topic.removeprefix("/link/").rpartition("/")[0]


def pose_in_frame(stamp_ns: int, frame: str, frame_T_object: Pose3) -> Json:
    """A ``foxglove.PoseInFrame``."""
    return {"timestamp": time(stamp_ns), "frame_id": frame, "pose": pose(frame_T_object)}


def transform(stamp_ns: int, parent: str, child: str, parent_T_child: Pose3) -> Json:
    """A ``foxglove.FrameTransform``."""
    return {
        "timestamp": time(stamp_ns),
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": vector(parent_T_child.translation()),
        "rotation": quaternion(parent_T_child),
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
    """Compact JSON. Numbers that JSON cannot represent (NaN) become null."""
    try:
        return _ENCODER.encode(content).encode()
    except ValueError:
        return json.dumps(_without_nan(content), separators=(",", ":")).encode()


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")


_ENCODER = json.JSONEncoder(separators=(",", ":"), allow_nan=False, default=_plain)


def _without_nan(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
