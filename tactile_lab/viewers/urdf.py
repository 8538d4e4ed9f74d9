"""The robot's description as URDF, of primitive shapes only: it needs no other file.

URDF knows boxes, cylinders and spheres. A capsule becomes a cylinder and two spheres; an ellipsoid becomes the capsule
along its longest axis with the same length and the mean of the other two semi-axes.
"""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree import ElementTree as ET

import numpy as np
from gtsam import Pose3, Rot3

from tactile_lab.viewers.parts import BoxPart, CapsulePart, EllipsoidPart, Part, rotation_onto
from tactile_lab.viewers.robot import TABLE, WORLD, Robot, RobotJoint, table_part

_COLOURS = {"hand": "0.47 0.50 0.54 1", "tip": "0.36 0.44 0.56 1", "table": "0.80 0.82 0.85 1"}
_EFFORT, _VELOCITY = "10", "4"
"""URDF demands both of a moving joint; no program of ours reads them."""


def urdf(robot: Robot) -> str:
    """The robot with the frames and joint names of the recordings; its root is ``world``."""
    root = ET.Element("robot", name=f"{robot.prefix}laboratory")
    for name, rgba in _COLOURS.items():
        ET.SubElement(ET.SubElement(root, "material", name=name), "color", rgba=rgba)
    for link in [WORLD, *(joint.child for joint in robot.joints)]:
        element = ET.SubElement(root, "link", name=link)
        parts = (table_part(robot),) if link == TABLE else robot.parts.get(link, ())
        for part in parts:
            colour = "table" if link == TABLE else "tip" if link.endswith("distal") else "hand"
            _visuals(element, part, colour)
    for joint in robot.joints:
        _joint(root, joint)
    ET.indent(root)
    return '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def capsule_of(part: EllipsoidPart) -> CapsulePart:
    """The capsule along an ellipsoid's longest axis, as long as it."""
    axis = int(np.argmax(part.semi_axes_m))
    radius_m = float(np.mean(np.delete(part.semi_axes_m, axis)))
    turned = Pose3(Rot3(rotation_onto(np.eye(3)[axis])), np.zeros(3))
    return CapsulePart(part.link_T_part * turned, 2 * (part.semi_axes_m[axis] - radius_m), radius_m)


def _visuals(link: ET.Element, part: Part, colour: str) -> None:
    for kind in ("visual", "collision"):
        for pose, shape, sizes in _primitives(part):
            element = ET.SubElement(link, kind)
            element.append(_origin(pose))
            ET.SubElement(ET.SubElement(element, "geometry"), shape, sizes)
            if kind == "visual":
                ET.SubElement(element, "material", name=colour)


def _primitives(part: Part) -> Iterator[tuple[Pose3, str, dict[str, str]]]:
    """Pose, name and sizes of each primitive of URDF."""
    if isinstance(part, BoxPart):
        yield part.link_T_part, "box", {"size": _numbers(part.size_m)}
        return
    if isinstance(part, EllipsoidPart):
        if np.ptp(part.semi_axes_m) < 1e-9:
            yield part.link_T_part, "sphere", {"radius": _number(part.semi_axes_m[0])}
            return
        part = capsule_of(part)
    radius = _number(part.radius_m)
    if part.length_m > 0.0:
        yield part.link_T_part, "cylinder", {"radius": radius, "length": _number(part.length_m)}
    for end in (-0.5, 0.5):
        place = part.link_T_part * Pose3(Rot3(), np.array([0.0, 0.0, end * part.length_m]))
        yield place, "sphere", {"radius": radius}


def _joint(root: ET.Element, joint: RobotJoint) -> None:
    element = ET.SubElement(root, "joint", name=joint.name, type=joint.kind)
    element.append(_origin(joint.parent_T_child))
    ET.SubElement(element, "parent", link=joint.parent)
    ET.SubElement(element, "child", link=joint.child)
    if joint.kind != "fixed":
        ET.SubElement(element, "axis", xyz=_numbers(joint.axis))
        lower, upper = joint.limits
        limits = {"lower": _number(lower), "upper": _number(upper), "effort": _EFFORT, "velocity": _VELOCITY}
        ET.SubElement(element, "limit", limits)


def _origin(pose: Pose3) -> ET.Element:
    roll, pitch, yaw = pose.rotation().rpy()
    return ET.Element("origin", xyz=_numbers(pose.translation()), rpy=_numbers((roll, pitch, yaw)))


def _number(value: float) -> str:
    return f"{value:.9g}"


def _numbers(values: object) -> str:
    return " ".join(_number(float(value)) for value in np.asarray(values))
