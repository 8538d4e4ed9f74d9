"""Values and JSON schemas of Foxglove's larger types: joint states, point clouds, scene updates, camera calibration.

Field names are Foxglove's published ones; its viewers recognize a schema by its name.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import Array, Contact

Json = dict[str, Any]

_FLOAT64 = 8
"""Number of the type in ``foxglove.NumericType``."""

ARROW_LENGTH_m = 0.02
"""Length of the arrow that shows a contact's normal."""


def fields(**properties: Json) -> Json:
    """A JSON schema of an object with these properties."""
    return {"type": "object", "properties": properties}


def list_of(items: Json) -> Json:
    """A JSON schema of an array."""
    return {"type": "array", "items": items}


NUMBER, INTEGER, TEXT = {"type": "number"}, {"type": "integer"}, {"type": "string"}
BYTES = {"type": "string", "contentEncoding": "base64"}
TIME = fields(sec=INTEGER, nsec=INTEGER)
VECTOR = fields(x=NUMBER, y=NUMBER, z=NUMBER)
QUATERNION = fields(x=NUMBER, y=NUMBER, z=NUMBER, w=NUMBER)
POSE = fields(position=VECTOR, orientation=QUATERNION)
_COLOUR = fields(r=NUMBER, g=NUMBER, b=NUMBER, a=NUMBER)

JOINT_STATES = fields(timestamp=TIME, joints=list_of(fields(name=TEXT, position=NUMBER)))
POINT_CLOUD = fields(
    timestamp=TIME,
    frame_id=TEXT,
    pose=POSE,
    point_stride=INTEGER,
    fields=list_of(fields(name=TEXT, offset=INTEGER, type=INTEGER)),
    data=BYTES,
)
_ARROW = fields(
    pose=POSE,
    shaft_length=NUMBER,
    shaft_diameter=NUMBER,
    head_length=NUMBER,
    head_diameter=NUMBER,
    color=_COLOUR,
)
_ENTITY = fields(
    timestamp=TIME,
    frame_id=TEXT,
    id=TEXT,
    lifetime=TIME,
    frame_locked={"type": "boolean"},
    metadata=list_of(fields(key=TEXT, value=TEXT)),
    arrows=list_of(_ARROW),
)
SCENE_UPDATE = fields(deletions=list_of(fields(timestamp=TIME, type=INTEGER, id=TEXT)), entities=list_of(_ENTITY))
CAMERA_CALIBRATION = fields(
    timestamp=TIME,
    frame_id=TEXT,
    width=INTEGER,
    height=INTEGER,
    distortion_model=TEXT,
    D=list_of(NUMBER),
    K=list_of(NUMBER),
    R=list_of(NUMBER),
    P=list_of(NUMBER),
)


def time(stamp_ns: int) -> Json:
    """Nanoseconds as Foxglove's seconds and nanoseconds."""
    return {"sec": stamp_ns // NANOSECONDS, "nsec": stamp_ns % NANOSECONDS}


def vector(values: Array) -> Json:
    """A Foxglove vector or point."""
    x, y, z = (float(value) for value in values)
    return {"x": x, "y": y, "z": z}


def pose(target_T_source: Pose3) -> Json:
    """A Foxglove pose."""
    return {"position": vector(target_T_source.translation()), "orientation": quaternion(target_T_source)}


def pose_of(position: Mapping[str, float], orientation: Mapping[str, float]) -> Pose3:
    """The pose of a Foxglove vector and quaternion."""
    rotation = Rot3.Quaternion(orientation["w"], orientation["x"], orientation["y"], orientation["z"])
    return Pose3(rotation, np.array([position["x"], position["y"], position["z"]]))


def quaternion(target_T_source: Pose3) -> Json:
    """A Foxglove quaternion."""
    rotation: Any = target_T_source.rotation().toQuaternion()
    return {"x": rotation.x(), "y": rotation.y(), "z": rotation.z(), "w": rotation.w()}


def joint_states(stamp_ns: int, positions: Mapping[str, float]) -> Json:
    """A ``foxglove.JointStates``: radians, metres for sliding joints."""
    joints = [{"name": name, "position": float(position)} for name, position in positions.items()]
    return {"timestamp": time(stamp_ns), "joints": joints}


def point_cloud(stamp_ns: int, frame: str, columns: Mapping[str, Array]) -> Json:
    """A ``foxglove.PointCloud`` of equally long columns, x, y and z among them, as 64-bit numbers."""
    table = np.column_stack([np.asarray(column, dtype="<f8") for column in columns.values()])
    described = [{"name": name, "offset": 8 * i, "type": _FLOAT64} for i, name in enumerate(columns)]
    return {
        "timestamp": time(stamp_ns),
        "frame_id": frame,
        "pose": pose(Pose3()),
        "point_stride": 8 * len(columns),
        "fields": described,
        "data": base64.b64encode(table.tobytes()).decode(),
    }


def contact_cloud(stamp_ns: int, contacts: Sequence[Contact]) -> Json:
    """Contacts as points with their normals and forces, world frame."""
    points = np.array([contact.point_world_m for contact in contacts]).reshape(-1, 3)
    normals = np.array([contact.normal_world for contact in contacts]).reshape(-1, 3)
    columns = dict(zip(("x", "y", "z"), points.T, strict=True))
    columns |= dict(zip(("normal_x", "normal_y", "normal_z"), normals.T, strict=True))
    columns["force_N"] = np.array([contact.force_N for contact in contacts])
    return point_cloud(stamp_ns, "world", columns)


def contact_scene(stamp_ns: int, index: int, contacts: Iterable[Contact]) -> Json:
    """The contacts of a grasp as a ``foxglove.SceneUpdate``: an arrow along each normal; earlier grasps remain."""
    entity = {
        "timestamp": time(stamp_ns),
        "frame_id": "world",
        "id": f"grasp-{index}",
        "lifetime": time(0),
        "frame_locked": False,
        "metadata": [{"key": "grasp", "value": str(index)}],
        "arrows": [_arrow(contact) for contact in contacts],
    }
    return {"deletions": [], "entities": [entity]}


def camera_calibration(stamp_ns: int, matrix: Array, distortion: Sequence[float], size_px: tuple[int, int]) -> Json:
    """A ``foxglove.CameraCalibration`` of a pinhole camera with Brown's distortion."""
    projection = np.hstack([matrix, np.zeros((3, 1))])
    return {
        "timestamp": time(stamp_ns),
        "frame_id": "camera",
        "width": size_px[0],
        "height": size_px[1],
        "distortion_model": "rational_polynomial" if len(distortion) > 5 else "plumb_bob",
        "D": [float(value) for value in distortion],
        "K": matrix.ravel().tolist(),
        "R": np.eye(3).ravel().tolist(),
        "P": projection.ravel().tolist(),
    }


def _arrow(contact: Contact) -> Json:
    """Along the normal: an arrow of Foxglove's points along x."""
    along = np.asarray(contact.normal_world, dtype=float)
    helper = np.eye(3)[int(np.argmin(np.abs(along)))]
    side = np.cross(along, helper)
    side /= np.linalg.norm(side)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([along, side, np.cross(along, side)])
    matrix[:3, 3] = contact.point_world_m
    return {
        "pose": pose(Pose3(matrix)),
        "shaft_length": 0.75 * ARROW_LENGTH_m,
        "shaft_diameter": 0.1 * ARROW_LENGTH_m,
        "head_length": 0.25 * ARROW_LENGTH_m,
        "head_diameter": 0.2 * ARROW_LENGTH_m,
        "color": {"r": 0.9, "g": 0.3, "b": 0.1, "a": 1.0},
    }
