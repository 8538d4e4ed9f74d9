"""What messages of a session tell, as values: one place that reads each topic, for viewers, pages and tables.

Every function takes a message's content, parsed from JSON, and raises KeyError, TypeError or ValueError where that is
not as :mod:`~sessions.recording.traffic.schemas` describes it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from gtsam import Pose3
from numpy.typing import NDArray

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import Array
from sessions.recording.traffic.foxglove import pose_of


@dataclass(frozen=True)
class Touch:
    """A contact of a grasp, world frame: point (3,), normal out of the object (3,), covariance (3, 3) in m^2."""

    finger: str
    point_world_m: Array
    normal_world: Array
    covariance_m2: Array
    force_N: float


@dataclass(frozen=True)
class ToldSurface:
    """The estimated surface in the object frame; an outline (dimension 2) is a ring of vertices without faces.

    Attributes:
        dimension: 2 or 3.
        vertices_m: shape (n, 3).
        faces: indices of vertices, shape (m, 3).
        sigma_m: standard deviation along the normal at each vertex, shape (n,).
        explored: share that is known, 0 to 1.
        origin_height_m: height of the object frame's origin over the table.
    """

    dimension: int
    vertices_m: Array
    faces: NDArray[np.int64]
    sigma_m: Array
    explored: float
    origin_height_m: float


def stamp_ns(content: Mapping[str, Any]) -> int:
    """The session clock's time in a message, nanoseconds."""
    return int(content["timestamp"]["sec"]) * NANOSECONDS + int(content["timestamp"]["nsec"])


def pose(content: Mapping[str, Any]) -> Pose3:
    """``world_T_object`` of a pose, estimated or true."""
    return pose_of(content["pose"]["position"], content["pose"]["orientation"])


def covariance(content: Mapping[str, Any]) -> Array | None:
    """Covariance of x, y (m) and yaw (rad) of an estimate, shape (3, 3); None if it has none."""
    found = content.get("covariance")
    return None if found is None else np.array(found, dtype=float)


def grasp(content: Mapping[str, Any]) -> tuple[int, tuple[Touch, ...]]:
    """Index of a grasp, from 0, and its contacts."""
    return int(content["index"]), tuple(_touch(one) for one in content["contacts"])


def surface(content: Mapping[str, Any]) -> ToldSurface:
    """The estimated surface; no vertices if there is none."""
    return ToldSurface(
        dimension=int(content["dimension"]),
        vertices_m=np.array(content["vertices_m"], dtype=float).reshape(-1, 3),
        faces=np.array(content["faces"], dtype=np.int64).reshape(-1, 3),
        sigma_m=np.array(content["sigma_m"], dtype=float),
        explored=float(content["explored"]),
        origin_height_m=float(content["origin_height_m"]),
    )


def _touch(content: Mapping[str, Any]) -> Touch:
    return Touch(
        finger=str(content["finger"]),
        point_world_m=np.array(content["point_world_m"], dtype=float),
        normal_world=np.array(content["normal_world"], dtype=float),
        covariance_m2=np.array(content["point_covariance_m2"], dtype=float),
        force_N=float(content["force_N"]),
    )
