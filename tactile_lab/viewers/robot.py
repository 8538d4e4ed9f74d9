"""The robot as other programs know it: a tree of named frames from the world to the fingertips, with its shapes.

Joints and links of the hand have Shadow's own names (``rh_FFJ3`` turns ``rh_ffproximal``; ``lh_`` for
a left hand). The positioner is a chain of its six coordinates, whatever arm moves it (see
:mod:`drivers.positioner.kinematics`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.contacts import Array
from drivers.positioner.kinematics import mount_T_forearm
from drivers.shadow.model.bodies import FOREARM, LINK_SHAPES, mirror_shape
from drivers.shadow.model.hand_form import HandForm
from drivers.shadow.model.kinematics import JOINTS, Joint, joint_table
from tactile_lab.viewers.parts import BoxPart, EllipsoidPart, Part, part_of

WORLD, TABLE, MOUNT, OBJECT, TRUE_OBJECT, CAMERA = "world", "table", "mount", "object", "object_true", "camera"
"""Frames beside the robot's links."""

POSITIONER_JOINTS = ("base_x", "base_y", "base_z", "base_yaw", "base_pitch", "base_roll")
"""The positioner's coordinates as joints, in their order: metres, then radians."""

_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
_FINGER_LINKS = {"J4": "knuckle", "J3": "proximal", "J2": "middle", "J1": "distal"}
_LINKS = {
    "WRJ2": "wrist",
    "WRJ1": "palm",
    "LFJ5": "lfmetacarpal",
    "THJ5": "thbase",
    "THJ4": "thproximal",
    "THJ3": "thhub",
    "THJ2": "thmiddle",
    "THJ1": "thdistal",
    **{
        f"{finger}{joint}": finger.lower() + link
        for finger in ("FF", "MF", "RF", "LF")
        for joint, link in _FINGER_LINKS.items()
    },
}
"""Name of each joint's child link in Shadow's description, without the hand's prefix."""

Kind = Literal["revolute", "prismatic", "fixed"]


@dataclass(frozen=True)
class RobotJoint:
    """A joint, or a fixed connection, between two frames.

    Attributes:
        parent, child: names of the frames.
        parent_T_child: at position 0.
        axis: unit vector in the child's frame, of the rotation or the translation.
        limits: radians, or metres for ``prismatic``.
    """

    name: str
    kind: Kind
    parent: str
    child: str
    parent_T_child: Pose3
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    limits: tuple[float, float] = (0.0, 0.0)

    def at(self, position: float) -> Pose3:
        """The child's frame in the parent's at a position (radians or metres)."""
        along = position * np.array(self.axis)
        if self.kind == "prismatic":
            return self.parent_T_child * Pose3(Rot3(), along)
        return self.parent_T_child * Pose3(Rot3.Expmap(along), np.zeros(3))


@dataclass(frozen=True)
class Placement:
    """One frame in another."""

    parent: str
    child: str
    parent_T_child: Pose3


@dataclass(frozen=True)
class Tip:
    """A fingertip that is fitted: pose and semi-axes of the ellipsoid that touches, and its sensor's frame if any."""

    distal_T_skin: Pose3
    semi_axes_m: tuple[float, float, float]
    distal_T_sensor: Pose3 | None = None


@dataclass(frozen=True)
class Robot:
    """Hand, positioner and table.

    Attributes:
        joints: every connection between two frames, parents first.
        parts: what each link looks like, in its frame.
        table_size_m: of the table's plate, whose top is z = 0 of the frame ``table``.
    """

    form: HandForm
    joints: tuple[RobotJoint, ...]
    parts: Mapping[str, tuple[Part, ...]] = field(default_factory=dict)
    table_size_m: tuple[float, float, float] = (0.6, 0.6, 0.02)

    @property
    def prefix(self) -> str:
        """What Shadow's names of this hand begin with."""
        return prefix_of(self.form)

    def fixed(self) -> list[Placement]:
        """The frames that never move in their parents."""
        return [Placement(one.parent, one.child, one.parent_T_child) for one in self.joints if one.kind == "fixed"]

    def moving(self, positions: Mapping[str, float]) -> list[Placement]:
        """The other frames, with joints at named positions; those not named are at 0."""
        moved = [one for one in self.joints if one.kind != "fixed"]
        return [Placement(one.parent, one.child, one.at(positions.get(one.name, 0.0))) for one in moved]

    def positions(self, joints_rad: Array, base_q: Array) -> dict[str, float]:
        """Positions by the joints' names, of the joints that this hand has.

        Args:
            joints_rad: of the hand, shape (24,), order of :data:`drivers.shadow.model.kinematics.JOINTS`.
            base_q: of the positioner, shape (6,), metres and radians.
        """
        hand = {self.prefix + name: float(q) for name, q in zip(JOINTS, joints_rad, strict=True)}
        base = {name: float(q) for name, q in zip(POSITIONER_JOINTS, base_q, strict=True)}
        return {name: q for name, q in {**hand, **base}.items() if name in self.moving_joints}

    @cached_property
    def moving_joints(self) -> frozenset[str]:
        """Names of the joints that move."""
        return frozenset(one.name for one in self.joints if one.kind != "fixed")

    def distal_link(self, finger: str) -> str:
        """Name of a finger's last link."""
        return f"{self.prefix}{finger.lower()}distal"

    def sensor_frame(self, finger: str) -> str:
        """Name of the frame in which a finger's sensor measures."""
        return f"{self.prefix}{finger.lower()}sensor"


def prefix_of(form: HandForm) -> str:
    """What Shadow's names of a hand begin with."""
    return "lh_" if form.is_left else "rh_"


def make_robot(
    form: HandForm,
    world_T_mount: Pose3,
    tips: Mapping[str, Tip],
    ranges: tuple[tuple[float, float], ...],
    table_size_m: tuple[float, float, float],
    table_centre_m: tuple[float, float] = (0.0, 0.0),
) -> Robot:
    """The robot of a rig.

    Args:
        form: which hand it is.
        world_T_mount: the forearm-to-world calibration.
        tips: the fitted fingertips, by finger.
        ranges: of the positioner's six coordinates, metres and radians.
        table_size_m, table_centre_m: of the table's plate, world axes.
    """
    prefix = prefix_of(form)
    table = Pose3(Rot3(), np.array([*table_centre_m, 0.0]))
    joints = [
        RobotJoint("world_to_table", "fixed", WORLD, TABLE, table),
        RobotJoint("world_to_mount", "fixed", WORLD, MOUNT, world_T_mount),
        *_positioner(prefix, ranges),
        *_hand(form),
        *_sensors(prefix, tips),
    ]
    return Robot(form, tuple(joints), _parts(form, tips), table_size_m)


def _positioner(prefix: str, ranges: tuple[tuple[float, float], ...]) -> Iterator[RobotJoint]:
    parent = MOUNT
    for number, (name, axis, limits) in enumerate(zip(POSITIONER_JOINTS, _AXES, ranges, strict=True)):
        kind: Kind = "prismatic" if number < 3 else "revolute"
        yield RobotJoint(name, kind, parent, f"{name}_link", Pose3(), axis, limits)
        parent = f"{name}_link"
    yield RobotJoint("base_to_forearm", "fixed", parent, f"{prefix}forearm", mount_T_forearm(np.zeros(6)))


def _hand(form: HandForm) -> Iterator[RobotJoint]:
    """The joints that the hand has, parents first; those that it lacks on its way to a finger are fixed at 0."""
    prefix, table = prefix_of(form), {joint.name: joint for joint in joint_table(form.side)}
    for joint in sorted(table.values(), key=lambda joint: _depth(joint, table)):
        if joint.name[:2] in (*form.fingers, "WR"):
            parent = joint.parent if joint.parent in ("palm", "forearm") else _LINKS[joint.parent]
            kind: Kind = "revolute" if joint.name in form.joints else "fixed"
            limits = (float(np.radians(joint.lower_deg)), float(np.radians(joint.upper_deg)))
            roll, pitch, yaw = joint.rpy_rad
            origin = Pose3(Rot3.Ypr(yaw, pitch, roll), np.array(joint.origin_m))
            axis = tuple(np.array(joint.axis) / np.linalg.norm(joint.axis))
            yield RobotJoint(
                prefix + joint.name, kind, prefix + parent, prefix + _LINKS[joint.name], origin, axis, limits
            )


def _depth(joint: Joint, table: Mapping[str, Joint]) -> int:
    above = {"forearm": 0, "palm": 2}
    return 1 + (above[joint.parent] if joint.parent in above else _depth(table[joint.parent], table))


def _sensors(prefix: str, tips: Mapping[str, Tip]) -> Iterator[RobotJoint]:
    for finger, tip in tips.items():
        if tip.distal_T_sensor is not None:
            low = finger.lower()
            parent, child = f"{prefix}{low}distal", f"{prefix}{low}sensor"
            yield RobotJoint(f"{child}_mount", "fixed", parent, child, tip.distal_T_sensor)


def _parts(form: HandForm, tips: Mapping[str, Tip]) -> dict[str, tuple[Part, ...]]:
    prefix = prefix_of(form)
    own = {"forearm": FOREARM, **{_LINKS[name]: shapes for name, shapes in LINK_SHAPES.items() if _has(form, name)}}
    found = {
        prefix + link: tuple(part_of(mirror_shape(shape) if form.is_left else shape) for shape in shapes)
        for link, shapes in own.items()
    }
    for finger, tip in tips.items():
        link = f"{prefix}{finger.lower()}distal"
        found[link] = (*found.get(link, ()), EllipsoidPart(tip.distal_T_skin, tip.semi_axes_m))
    return found


def _has(form: HandForm, joint: str) -> bool:
    return joint[:2] in (*form.fingers, "WR")


def table_part(robot: Robot) -> BoxPart:
    """The table's plate in the frame ``table``."""
    return BoxPart(Pose3(Rot3(), np.array([0.0, 0.0, -robot.table_size_m[2] / 2])), robot.table_size_m)
