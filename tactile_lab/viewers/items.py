"""What viewers show of a session, without any format. Stamps are nanoseconds of the session's clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from gtsam import Pose3
from numpy.typing import NDArray

from drivers.core.contacts import Array
from sessions.recording.traffic.told import Touch
from tactile_lab.colours import SIGMA_FULL_m, viridis
from tactile_lab.viewers.robot import Placement


@dataclass(frozen=True)
class Frames:
    """Where frames are in others; ``lasting`` ones never move."""

    stamp_ns: int
    placements: tuple[Placement, ...]
    lasting: bool = False


@dataclass(frozen=True)
class Joints:
    """Positions by the names of the robot's description: radians, metres for sliding joints."""

    stamp_ns: int
    positions: Mapping[str, float]


@dataclass(frozen=True)
class Loads:
    """Contact force on each fingertip, newtons, minus weight and tare; None where it is not known."""

    stamp_ns: int
    load_N: Mapping[str, float | None]
    frames: Mapping[str, str]


@dataclass(frozen=True)
class SensorWrench:
    """A force sensor's raw reading in its own frame: force (N) and torque (N m), shape (3,) each."""

    stamp_ns: int
    finger: str
    frame: str
    force_N: Array
    torque_Nm: Array


@dataclass(frozen=True)
class Touches:
    """The contacts of a grasp; ``gone`` are earlier grasps with that number or a higher one, which were undone."""

    stamp_ns: int
    grasp: int
    touches: tuple[Touch, ...]
    gone: tuple[int, ...] = ()

    @property
    def points_world_m(self) -> Array:
        """Shape (n, 3)."""
        return np.array([one.point_world_m for one in self.touches]).reshape(-1, 3)

    @property
    def normals_world(self) -> Array:
        """Shape (n, 3)."""
        return np.array([one.normal_world for one in self.touches]).reshape(-1, 3)

    @property
    def forces_N(self) -> Array:
        """Shape (n,)."""
        return np.array([one.force_N for one in self.touches])


@dataclass(frozen=True)
class Surface:
    """The estimated surface in the object frame: vertices (n, 3), triangles (m, 3), standard deviation (n,), metres."""

    stamp_ns: int
    vertices_m: Array
    triangles: NDArray[np.int64]
    sigma_m: Array
    explored: float

    @property
    def colours(self) -> NDArray[np.uint8]:
        """Red, green, blue of each vertex, shape (n, 3): dark where certain, yellow from 10 mm on."""
        return viridis(self.sigma_m / SIGMA_FULL_m)


@dataclass(frozen=True)
class ObjectPose:
    """The object in the world, estimated or ``true``.

    Attributes:
        covariance: of a small motion in world axes, order x, y, z, roll, pitch, yaw (m, rad), shape (6, 6); what the
            estimate does not say is 0. None if it is not known.
    """

    stamp_ns: int
    world_T_object: Pose3
    covariance: Array | None = None
    true: bool = False


@dataclass(frozen=True)
class Candidate:
    """A grasp that could be next: the hand's frame on the table."""

    world_T_grasp: Pose3
    score: float | None
    chosen: bool


@dataclass(frozen=True)
class Candidates:
    """Grasps among which the next one was chosen, with the chosen one's description."""

    stamp_ns: int
    candidates: tuple[Candidate, ...]
    text: str


@dataclass(frozen=True)
class Picture:
    """A camera picture, JPEG or PNG."""

    stamp_ns: int
    encoded: bytes

    @property
    def kind(self) -> str:
        """``jpeg`` or ``png``."""
        return "png" if self.encoded.startswith(b"\x89PNG") else "jpeg"


@dataclass(frozen=True)
class Lens:
    """The camera's calibration: matrix (3, 3) in pixels, distortion in OpenCV's order."""

    stamp_ns: int
    matrix: Array
    distortion: tuple[float, ...]
    size_px: tuple[int, int]

    @property
    def model(self) -> str:
        """Name of the distortion model, as ROS and Foxglove call it."""
        return "rational_polynomial" if len(self.distortion) > 5 else "plumb_bob"


@dataclass(frozen=True)
class Remark:
    """A line of the session's log; ``level`` 2: information, 3: warning, 4: error."""

    stamp_ns: int
    level: int
    source: str
    text: str


Item: TypeAlias = (
    Frames | Joints | Loads | SensorWrench | Touches | Surface | ObjectPose | Candidates | Picture | Lens | Remark
)

Plain: TypeAlias = dict[str, Any]
