"""Text of a rigid body in the formats of robot simulators: URDF, SDF and MJCF.

Each names the mesh files beside it: ``visual.obj`` as it looks, ``part_N.obj`` for collisions.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree as ET

import numpy as np

from tactile_lab.models.solid_model import SolidModel

VISUAL_FILE = "visual.obj"
_COLOUR = "0.55 0.65 0.75 1"
_FLOOR_SIZE_m = "1 1 0.1"


def part_file(number: int) -> str:
    """Name of a convex part's file: OBJ, the one format of them that Drake takes for collisions."""
    return f"part_{number}.obj"


def urdf(model: SolidModel) -> str:
    """A robot of one link, its frame that of the model."""
    robot = ET.Element("robot", name=model.name)
    robot.append(ET.Comment(_remark(model)))
    link = ET.SubElement(robot, "link", name=model.name)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=_numbers(model.centre_m), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=_number(model.mass_kg))
    ET.SubElement(inertial, "inertia", dict(_moments(model)))
    visual = ET.SubElement(link, "visual")
    ET.SubElement(ET.SubElement(visual, "geometry"), "mesh", filename=VISUAL_FILE)
    for number in range(len(model.parts)):
        collision = ET.SubElement(link, "collision", name=f"part_{number}")
        ET.SubElement(ET.SubElement(collision, "geometry"), "mesh", filename=part_file(number))
    ET.SubElement(ET.SubElement(link, "contact"), "lateral_friction", value=_number(model.friction))
    return _text(robot)


def sdf(model: SolidModel) -> str:
    """A model of one link, for Gazebo and Drake."""
    root = ET.Element("sdf", version="1.10")
    body = ET.SubElement(root, "model", name=model.name)
    body.append(ET.Comment(_remark(model)))
    link = ET.SubElement(body, "link", name=model.name)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "pose").text = f"{_numbers(model.centre_m)} 0 0 0"
    ET.SubElement(inertial, "mass").text = _number(model.mass_kg)
    moments = ET.SubElement(inertial, "inertia")
    for name, value in _moments(model):
        ET.SubElement(moments, name).text = value
    _sdf_mesh(ET.SubElement(link, "visual", name="visual"), VISUAL_FILE)
    for number in range(len(model.parts)):
        collision = ET.SubElement(link, "collision", name=f"part_{number}")
        _sdf_mesh(collision, part_file(number))
        ode = ET.SubElement(ET.SubElement(ET.SubElement(collision, "surface"), "friction"), "ode")
        ET.SubElement(ode, "mu").text = ET.SubElement(ode, "mu2").text = _number(model.friction)
    return _text(root)


def mjcf(model: SolidModel) -> str:
    """A free body for MuJoCo, and a floor to stand on."""
    root = ET.Element("mujoco", model=model.name)
    custom = ET.SubElement(root, "custom")
    found = model.uncertainty
    told = [found.median_m, found.p95_m, found.largest_m, found.guessed_share]
    ET.SubElement(custom, "numeric", name="surface_sigma_m_median_p95_largest_guessed_share", data=_numbers(told))
    asset = ET.SubElement(root, "asset")
    ET.SubElement(asset, "mesh", name="visual", file=VISUAL_FILE)
    for number in range(len(model.parts)):
        ET.SubElement(asset, "mesh", name=f"part_{number}", file=part_file(number))
    world = ET.SubElement(root, "worldbody")
    ET.SubElement(world, "light", pos="0 0 1.5")
    ET.SubElement(world, "geom", name="floor", type="plane", size=_FLOOR_SIZE_m, friction=_friction(model))
    body = ET.SubElement(world, "body", name=model.name)
    ET.SubElement(body, "freejoint", name=model.name)
    full = _numbers([float(model.inertia_kg_m2[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))])
    mass = _number(model.mass_kg)
    ET.SubElement(body, "inertial", pos=_numbers(model.centre_m), mass=mass, fullinertia=full)
    ET.SubElement(
        body, "geom", name="visual", type="mesh", mesh="visual", contype="0", conaffinity="0", group="2", rgba=_COLOUR
    )
    for number in range(len(model.parts)):
        part = {"name": f"part_{number}", "type": "mesh", "mesh": f"part_{number}", "group": "3"}
        ET.SubElement(body, "geom", part, friction=_friction(model))
    return _text(root)


def _sdf_mesh(parent: ET.Element, file: str) -> None:
    mesh = ET.SubElement(ET.SubElement(parent, "geometry"), "mesh")
    ET.SubElement(mesh, "uri").text = file


def _moments(model: SolidModel) -> list[tuple[str, str]]:
    inertia, axes = model.inertia_kg_m2, "xyz"
    pairs = [(i, j) for i in range(3) for j in range(i, 3)]
    return [(f"i{axes[i]}{axes[j]}", _number(float(inertia[i, j]))) for i, j in pairs]


def _remark(model: SolidModel) -> str:
    found = model.uncertainty
    assumed = "assumed" if model.mass_is_assumed else "stated"
    return (
        f" metres, kilograms; surface uncertain by {1e3 * found.median_m:.1f} mm (median), {1e3 * found.p95_m:.1f} mm "
        f"(95 %); {100 * found.guessed_share:.0f} % of it is a guess between contacts; mass {assumed}; see model.json "
    )


def _friction(model: SolidModel) -> str:
    """Sliding, torsional (metres) and rolling friction, the latter two MuJoCo's defaults."""
    return f"{_number(model.friction)} 0.005 0.0001"


def _number(value: float) -> str:
    return f"{value:.9g}"


def _numbers(values: Sequence[float] | np.ndarray) -> str:
    return " ".join(_number(float(value)) for value in values)


def _text(root: ET.Element) -> str:
    ET.indent(root)
    return '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
