"""Simple solids that a link of the robot looks like: what a viewer can draw without a mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.contacts import Array
from drivers.shadow.model.bodies import Ball, Block, Capsule, Ellipsoid, Shape


@dataclass(frozen=True)
class EllipsoidPart:
    """An ellipsoid with semi-axes (metres) along the axes of its own frame."""

    link_T_part: Pose3
    semi_axes_m: tuple[float, float, float]


@dataclass(frozen=True)
class BoxPart:
    """A box with its full size (metres) along the axes of its own frame."""

    link_T_part: Pose3
    size_m: tuple[float, float, float]


@dataclass(frozen=True)
class CapsulePart:
    """A cylinder with round ends: its frame is in the middle, z along it; ``length_m`` is between the ends' centres."""

    link_T_part: Pose3
    length_m: float
    radius_m: float


Part: TypeAlias = EllipsoidPart | BoxPart | CapsulePart


def part_of(shape: Shape) -> Part:
    """A body of the hand as a part, in the same link."""
    if isinstance(shape, Capsule):
        return capsule_between(np.array(shape.start_m), np.array(shape.end_m), shape.radius_m)
    place = Pose3(Rot3(), np.array(shape.centre_m))
    if isinstance(shape, Block):
        x, y, z = shape.half_size_m
        return BoxPart(place, (2 * x, 2 * y, 2 * z))
    if isinstance(shape, Ball):
        return EllipsoidPart(place, (shape.radius_m, shape.radius_m, shape.radius_m))
    assert isinstance(shape, Ellipsoid)
    return EllipsoidPart(place, shape.semi_axes_m)


def capsule_between(start_m: Array, end_m: Array, radius_m: float) -> CapsulePart:
    """The capsule between two points of the link frame, shape (3,) each."""
    along = end_m - start_m
    length_m = float(np.linalg.norm(along))
    rotation = rotation_onto(along / length_m) if length_m > 0.0 else np.eye(3)
    return CapsulePart(Pose3(Rot3(rotation), (start_m + end_m) / 2), length_m, radius_m)


def rotation_onto(direction: Array, axis: int = 2) -> Array:
    """A rotation matrix whose column ``axis`` is a unit vector, shape (3,); the turn about it is arbitrary."""
    helper = np.eye(3)[int(np.argmin(np.abs(direction)))]
    side = np.cross(helper, direction)
    side /= np.linalg.norm(side)
    columns = [side, np.cross(direction, side), direction]
    return np.column_stack([columns[(place - axis + 2) % 3] for place in range(3)])
