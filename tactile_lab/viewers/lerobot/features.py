"""What a frame of a dataset holds of a moment: names, shapes, and how the values are read.

Everything is a number; an unknown value is 0, and another value marks it as unknown.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any, Literal

import numpy as np
import trimesh
from gtsam import Pose3

from drivers.core.contacts import Array
from sessions.recording.traffic.told import Touch
from tactile_lab.slam.shape.surfaces.sampling import sample_mesh_with_values
from tactile_lab.viewers.items import ObjectPose, Surface
from tactile_lab.viewers.lerobot.sampling import PHASES, Moment, SampledSession
from tactile_lab.viewers.robot import POSITIONER_JOINTS, Robot

STATE, ACTION = "observation.state", "action"
SURFACE_POINTS = 64
"""On the estimated surface, spread evenly."""

_POSE = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
_SIGMA = ("x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad")
_WRENCH = ("fx_N", "fy_N", "fz_N", "tx_Nm", "ty_Nm", "tz_Nm")
_CONTACT = ("touches", "x_m", "y_m", "z_m", "nx", "ny", "nz", "force_N")

Names = Sequence[str] | Mapping[str, Sequence[str]]


@dataclass(frozen=True)
class Feature:
    """A column of the dataset.

    Attributes:
        key: as LeRobot names it; policies are given what begins with ``observation``.
        dtype: of a value.
        shape: of a frame's values.
        names: of the values, with units.
        read: the values of a moment.
    """

    key: str
    dtype: Literal["float32", "int64"]
    shape: tuple[int, ...]
    names: Names
    read: Callable[[Moment], Any]

    def description(self) -> dict[str, Any]:
        """The entry of ``meta/info.json``."""
        return {"dtype": self.dtype, "shape": list(self.shape), "names": _plain(self.names)}


def features_of(sampled: SampledSession) -> tuple[Feature, ...]:
    """All features that the session's rig has."""
    found = [_state(sampled.robot), _demands(sampled), _loads(sampled.fingers)]
    if sampled.forces:
        found.append(_wrenches(sampled.forces))
    found += [_counts(finger, channels) for finger, channels in sampled.channels.items()]
    found += [_contacts(sampled.fingers), *_estimates()]
    if sampled.has_truth:
        found.append(Feature("truth.object_pose", "float32", (7,), _POSE, lambda now: _pose(now.truth)))
    found.append(Feature("grasps", "int64", (1,), ["grasps"], lambda now: [now.grasps]))
    found.append(Feature("subtask_index", "int64", (1,), ["subtask"], lambda now: [PHASES.index(now.phase)]))
    return tuple(found)


def state_names(robot: Robot) -> tuple[str, ...]:
    """Joints of hand and positioner, with units: those of the description that move."""
    joints = [one.name for one in robot.joints if one.name in robot.moving_joints]
    return tuple(f"{name}_{'m' if name in POSITIONER_JOINTS[:3] else 'rad'}" for name in joints)


def _vector(key: str, names: Sequence[str], read: Callable[[Moment], Any]) -> Feature:
    return Feature(key, "float32", (len(names),), names, read)


def _state(robot: Robot) -> Feature:
    joints = [one.name for one in robot.joints if one.name in robot.moving_joints]
    return _vector(STATE, state_names(robot), lambda now: [now.positions[name] for name in joints])


def _demands(sampled: SampledSession) -> Feature:
    motors = [motor for motor, name in enumerate(sampled.motors.names) if name]
    names = [f"{sampled.robot.prefix}{sampled.motors.names[motor]}_counts" for motor in motors]
    return _vector("motor_demand", names, lambda now: now.demands[motors])


def _loads(fingers: Sequence[str]) -> Feature:
    def read(now: Moment) -> list[float]:
        told = [now.loads_N.get(finger, 0.0) for finger in fingers]
        return [load_N if isfinite(load_N) else 0.0 for load_N in told]

    return _vector("observation.load", [f"{finger}_N" for finger in fingers], read)


def _wrenches(fingers: Sequence[str]) -> Feature:
    none = np.zeros(6)

    def read(now: Moment) -> Array:
        return np.concatenate([now.wrenches.get(finger, none) for finger in fingers])

    return _vector("observation.wrench", [f"{finger}_{name}" for finger in fingers for name in _WRENCH], read)


def _counts(finger: str, channels: Sequence[str]) -> Feature:
    def read(now: Moment) -> list[int]:
        return [now.counts[finger].get(channel) or 0 for channel in channels]

    return _vector(f"observation.biotac.{finger}", [f"{channel}_counts" for channel in channels], read)


def _contacts(fingers: Sequence[str]) -> Feature:
    def read(now: Moment) -> Array:
        touches = {} if now.touches is None else {one.finger: one for one in now.touches.touches}
        return np.concatenate([_contact(touches.get(finger)) for finger in fingers])

    return _vector("observation.contact", [f"{finger}_{name}" for finger in fingers for name in _CONTACT], read)


def _contact(touch: Touch | None) -> Array:
    if touch is None:
        return np.zeros(len(_CONTACT))
    return np.array([1.0, *touch.point_world_m, *touch.normal_world, touch.force_N])


def _estimates() -> Iterator[Feature]:
    yield Feature("observation.estimate.known", "float32", (1,), ["known"], lambda now: [now.estimate is not None])
    yield _vector("observation.estimate.pose", _POSE, lambda now: _pose(now.estimate))
    yield _vector("observation.estimate.pose_sigma", _SIGMA, lambda now: _sigma(now.estimate))
    yield Feature("observation.estimate.explored", "float32", (1,), ["share"], lambda now: [_explored(now.surface)])
    names = {"point": [str(number) for number in range(SURFACE_POINTS)], "value": ["x_m", "y_m", "z_m", "sigma_m"]}
    yield Feature("observation.estimate.surface", "float32", (SURFACE_POINTS, 4), names, _SurfaceSamples())


def _pose(told: ObjectPose | None) -> Array:
    """Place and quaternion in the world; that of the world itself where it is not known."""
    pose = Pose3() if told is None else told.world_T_object
    turn: Any = pose.rotation().toQuaternion()
    return np.array([*pose.translation(), turn.x(), turn.y(), turn.z(), turn.w()])


def _sigma(told: ObjectPose | None) -> Array:
    """Standard deviations about the world's axes."""
    if told is None or told.covariance is None:
        return np.zeros(len(_SIGMA))
    return np.sqrt(np.maximum(np.diag(told.covariance), 0.0))


def _explored(surface: Surface | None) -> float:
    return 0.0 if surface is None else surface.explored


class _SurfaceSamples:
    """Points spread over the newest surface, object frame, with standard deviations; made once for each surface."""

    def __init__(self) -> None:
        self._of: Surface | None = None
        self._points = np.zeros((SURFACE_POINTS, 4))

    def __call__(self, now: Moment) -> Array:
        if now.surface is not self._of and now.surface is not None:
            self._of, self._points = now.surface, _spread(now.surface)
        return self._points


def _spread(surface: Surface) -> Array:
    if not len(surface.triangles):
        return np.zeros((SURFACE_POINTS, 4))
    mesh = trimesh.Trimesh(surface.vertices_m, surface.triangles, process=False)
    points_m, sigma_m = sample_mesh_with_values(mesh, surface.sigma_m, SURFACE_POINTS)
    return np.column_stack([points_m, sigma_m])


def _plain(names: Names) -> Any:
    if isinstance(names, Mapping):
        return {name: list(values) for name, values in names.items()}
    return list(names)
