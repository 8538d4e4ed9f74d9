"""Pieces of Foxglove's messages: times, poses, colours, solids, arrows, entities and clouds of points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import foxglove.messages as fm
import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import Array
from tactile_lab.viewers.parts import BoxPart, CapsulePart, EllipsoidPart, Part, rotation_onto
from tactile_lab.viewers.robot import TABLE, Placement

Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, each from 0 to 1."""
TIP_COLOUR: Colour = (0.36, 0.44, 0.56, 1.0)
_HAND, _PLATE, _ELLIPSOID = (0.47, 0.50, 0.54, 1.0), (0.86, 0.88, 0.90, 1.0), (0.9, 0.3, 0.1, 0.35)
_SIGMAS = 2.0
_FLOAT32, _UINT8 = fm.PackedElementFieldNumericType.Float32, fm.PackedElementFieldNumericType.Uint8


def link_entity(stamp_ns: int, link: str, solids: Sequence[Part]) -> Any:
    """A link of the robot as solids fixed to its frame."""
    colour = _PLATE if link == TABLE else TIP_COLOUR if link.endswith("distal") else _HAND
    cubes, spheres, cylinders = [], [], []
    for part in solids:
        if isinstance(part, BoxPart):
            cubes.append(
                fm.CubePrimitive(
                    pose=pose_message(part.link_T_part), size=vector_message(part.size_m), color=colour_message(colour)
                )
            )
        elif isinstance(part, EllipsoidPart):
            spheres.append(sphere(part.link_T_part, 2 * np.array(part.semi_axes_m), colour))
        else:
            cylinders.append(_cylinder(part, colour))
            spheres += [sphere(end, np.full(3, 2 * part.radius_m), colour) for end in _ends(part)]
    return lasting_entity(stamp_ns, link, link, cubes=cubes, spheres=spheres, cylinders=cylinders, locked=True)


def _ends(part: CapsulePart) -> list[Pose3]:
    half = np.array([0.0, 0.0, part.length_m / 2])
    return [part.link_T_part * Pose3(Rot3(), sign * half) for sign in (-1.0, 1.0)]


def _cylinder(part: CapsulePart, colour: Colour) -> Any:
    size = vector_message((2 * part.radius_m, 2 * part.radius_m, part.length_m))
    pose = pose_message(part.link_T_part)
    return fm.CylinderPrimitive(pose=pose, size=size, bottom_scale=1.0, top_scale=1.0, color=colour_message(colour))


def sphere(pose: Pose3, size_m: Array, colour: Colour) -> Any:
    """A sphere, or an ellipsoid if its three diameters differ."""
    return fm.SpherePrimitive(pose=pose_message(pose), size=vector_message(size_m), color=colour_message(colour))


def uncertainty_ellipsoid(point_m: Array, covariance_m2: Array) -> Any:
    """An ellipsoid of two standard deviations about a point."""
    variances, axes = np.linalg.eigh(covariance_m2)
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    size_m = 2 * _SIGMAS * np.sqrt(np.maximum(variances, 0.0))
    return sphere(Pose3(Rot3(axes), point_m), size_m, _ELLIPSOID)


def arrow(start_m: Array, direction: Array, length_m: float, colour: Colour) -> Any:
    """An arrow along a unit vector; Foxglove's point along x."""
    pose = pose_message(Pose3(Rot3(rotation_onto(np.asarray(direction), axis=0)), np.asarray(start_m)))
    return fm.ArrowPrimitive(
        pose=pose,
        shaft_length=0.75 * length_m,
        shaft_diameter=0.0015,
        head_length=0.25 * length_m,
        head_diameter=0.004,
        color=colour_message(colour),
    )


def lasting_entity(
    stamp_ns: int, frame: str, name: str, *, locked: bool = False, facts: Mapping[str, str] | None = None, **solids: Any
) -> Any:
    """An entity that stays until one of the same name replaces it."""
    pairs = [fm.KeyValuePair(key=key, value=value) for key, value in (facts or {}).items()]
    return fm.SceneEntity(
        timestamp=timestamp(stamp_ns),
        frame_id=frame,
        id=name,
        lifetime=fm.Duration(0, 0),
        frame_locked=locked,
        metadata=pairs,
        **solids,
    )


def deletion(stamp_ns: int, name: str) -> Any:
    """Takes the entity of this name away."""
    return fm.SceneEntityDeletion(timestamp=timestamp(stamp_ns), type=fm.SceneEntityDeletionType.MatchingId, id=name)


def point_cloud(stamp_ns: int, frame: str, columns: Mapping[str, Array], colours: Any = None) -> Any:
    """Points with columns as 32-bit numbers, x, y and z among them; with red, green, blue and alpha if coloured."""
    dtype = [(name, "<f4") for name in columns]
    fields = [fm.PackedElementField(name=name, offset=4 * i, type=_FLOAT32) for i, name in enumerate(columns)]
    if colours is not None:
        names, begin = ("red", "green", "blue", "alpha"), 4 * len(columns)
        dtype += [(name, "u1") for name in names]
        fields += [fm.PackedElementField(name=name, offset=begin + i, type=_UINT8) for i, name in enumerate(names)]
    table = np.zeros(len(next(iter(columns.values()))), dtype=dtype)
    for name, column in columns.items():
        table[name] = column
    if colours is not None:
        for name, channel in zip(("red", "green", "blue"), colours.T, strict=True):
            table[name] = channel
        table["alpha"] = 255
    return fm.PointCloud(
        timestamp=timestamp(stamp_ns),
        frame_id=frame,
        pose=pose_message(Pose3()),
        point_stride=table.dtype.itemsize,
        fields=fields,
        data=table.tobytes(),
    )


def frame_transform(stamp_ns: int, placement: Placement) -> Any:
    """Where a frame is in its parent."""
    return fm.FrameTransform(
        timestamp=timestamp(stamp_ns),
        parent_frame_id=placement.parent,
        child_frame_id=placement.child,
        translation=vector_message(placement.parent_T_child.translation()),
        rotation=_quaternion(placement.parent_T_child),
    )


def timestamp(stamp_ns: int) -> Any:
    """Nanoseconds as seconds and the rest."""
    return fm.Timestamp(stamp_ns // NANOSECONDS, stamp_ns % NANOSECONDS)


def pose_message(pose: Pose3) -> Any:
    """A pose as position and quaternion."""
    return fm.Pose(position=vector_message(pose.translation()), orientation=_quaternion(pose))


def vector_message(values: Any) -> Any:
    """Three numbers."""
    x, y, z = (float(value) for value in values)
    return fm.Vector3(x=x, y=y, z=z)


def _quaternion(pose: Pose3) -> Any:
    turn: Any = pose.rotation().toQuaternion()
    return fm.Quaternion(x=turn.x(), y=turn.y(), z=turn.z(), w=turn.w())


def colour_message(colour: Colour) -> Any:
    """A colour."""
    red, green, blue, alpha = colour
    return fm.Color(r=red, g=green, b=blue, a=alpha)
