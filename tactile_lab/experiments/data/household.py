"""Everyday things from kitchen and workshop, defined by a few dimensions, as a complement to prisms.

All of them lie or stand as on a table: z up, in metres; each builder chooses the origin. Cups and bowls are hollow.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
import trimesh

from drivers.simulation.objects import prism_mesh
from tactile_lab.slam.shape.surfaces.level_sets import level_mesh

Distance: TypeAlias = Callable[[Any, Any, Any], Any]
"""Approximate signed distance from a solid at coordinates x, y and z, negative inside, metres."""

_GRID_m = 0.0015
_OFF_NODE_m = 1e-6
"""Offset of the grid: a surface through a grid node would give triangles without area."""
_SECTIONS = 96


def surface_of(distance: Distance, lower_m: tuple[float, ...], upper_m: tuple[float, ...]) -> trimesh.Trimesh:
    """The closed surface of a solid given by its signed distance, by marching cubes in a box given by two corners."""
    axes = [np.arange(low, high, _GRID_m) for low, high in zip(lower_m, upper_m, strict=True)]
    values = distance(*np.meshgrid(*axes, indexing="ij"))
    values[np.abs(values) < _OFF_NODE_m] = _OFF_NODE_m
    places, faces = level_mesh(values)
    mesh = trimesh.Trimesh(_GRID_m * places + [axis[0] for axis in axes], faces)
    if mesh.volume < 0:
        mesh.invert()
    return mesh


def capped_cylinder(radial_m: Any, along_m: Any, *, radius_m: float, half_length_m: float) -> Any:
    """Signed distance to a cylinder, from the distance to its axis and the position along it."""
    beside, above = radial_m - radius_m, np.abs(along_m) - half_length_m
    outside = np.hypot(np.maximum(beside, 0.0), np.maximum(above, 0.0))
    return np.minimum(np.maximum(beside, above), 0.0) + outside


def blend(one_m: Any, other_m: Any, width_m: float) -> Any:
    """The union of two solids given by signed distances, with their seam rounded over ``width_m``."""
    near = np.maximum(width_m - np.abs(one_m - other_m), 0.0) / width_m
    return np.minimum(one_m, other_m) - near**2 * width_m / 4


def turned(radii_mm: Sequence[float], heights_mm: Sequence[float]) -> trimesh.Trimesh:
    """A solid of revolution from its profile, which starts and ends on the axis and goes upward on the outside."""
    profile = np.column_stack([radii_mm, heights_mm]) / 1000
    mesh: trimesh.Trimesh = trimesh.creation.revolve(profile, sections=_SECTIONS)
    return mesh


def _bottle() -> trimesh.Trimesh:
    """Body of 70 mm diameter with rounded shoulders and a neck of 28 mm, 130 mm high."""
    radii = [0, 32, 35, 35, 34, 30, 23, 17, 14, 14, 12, 0]
    return turned(radii, [-65, -65, -61, 12, 22, 32, 41, 47, 53, 63, 65, 65])


def _cup() -> trimesh.Trimesh:
    """A tapered cup without a handle: 60 mm wide at the foot, 84 mm at the rim, 95 mm high, with a wall of 4 mm."""
    return turned([0, 28, 30, 42, 40, 38, 26, 0], [0, 0, 2, 93, 95, 93, 6, 6])


def _cup_with_handle() -> trimesh.Trimesh:
    """The same cup, 90 mm high, with a handle towards +x, 12 mm thick, that leaves room for a finger."""

    def distance(x: Any, y: Any, z: Any) -> Any:
        radial = np.hypot(x, y)
        taper = 0.0325 + 0.1 * z
        outer = np.maximum(radial - taper, np.maximum(z - 0.090, -z))
        cavity = np.maximum(radial - taper + 0.0045, 0.006 - z)
        handle = np.hypot(np.hypot((x - 0.040) / 0.9, z - 0.045) - 0.028, y) - 0.006
        handle = np.maximum(handle, taper - 0.003 - radial)
        return np.maximum(blend(outer, handle, 0.004), -cavity)

    return surface_of(distance, (-0.045, -0.045, -0.003), (0.076, 0.046, 0.093))


def _bowl() -> trimesh.Trimesh:
    """A bowl of 120 mm diameter and 52 mm height on a foot of 54 mm, with a wall of 5 mm."""
    outside = [(27, 0), (27, 4), (36, 8), (46, 17), (53, 28), (57, 40), (60, 51)]
    inside = [(58, 52), (55, 51), (52, 40), (48, 29), (41, 19), (32, 12), (20, 8)]
    radii, heights = zip((0, 0), *outside, *inside, (0, 7), strict=True)
    return turned(radii, heights)


def _tin() -> trimesh.Trimesh:
    """A flat tin of 84 mm diameter and 38 mm height with a lid recessed by 2 mm."""
    return turned([0, 40, 42, 42, 41, 41, 42, 42, 40, 40, 0], [0, 0, 2, 4, 5, 33, 34, 37, 38, 36, 36])


def _wedge() -> trimesh.Trimesh:
    """100 x 60 mm at the foot, 60 mm high at one end and 15 mm at the other: its top slopes by 24 degrees."""
    corners = [(x, y, z) for y in (-30, 30) for x, z in ((-50, 0), (50, 0), (50, 15), (-50, 60))]
    mesh: trimesh.Trimesh = trimesh.convex.convex_hull(np.array(corners) / 1000)
    return mesh


def _t_block() -> trimesh.Trimesh:
    """A bar of 100 x 34 mm and a stem of 34 x 60 mm, lying, 40 mm high."""
    outline = [(-17, 60), (-17, 0), (17, 0), (17, 60), (50, 60), (50, 94), (-50, 94), (-50, 60)]
    return prism_mesh(np.array(outline) / 1000, 0.040)


def _hammer() -> trimesh.Trimesh:
    """Lying: a head of 34 mm diameter and 100 mm length along y, a handle of 24 mm diameter and 110 mm length along
    x.
    """

    def distance(x: Any, y: Any, z: Any) -> Any:
        head = capped_cylinder(np.hypot(x, z - 0.017), y, radius_m=0.017, half_length_m=0.050)
        handle = capped_cylinder(np.hypot(y, z - 0.014), x - 0.060, radius_m=0.012, half_length_m=0.055)
        return blend(head, handle, 0.004)

    return surface_of(distance, (-0.020, -0.053, -0.003), (0.118, 0.054, 0.037))


def _banana() -> trimesh.Trimesh:
    """Lying: an arc of 80 mm radius over 110 degrees, 36 mm thick in the middle and 16 mm at its round ends."""

    def distance(x: Any, y: Any, z: Any) -> Any:
        angle = np.clip(np.arctan2(y, x), -_HALF_BOW_rad, _HALF_BOW_rad)
        away = np.sqrt((x - 0.080 * np.cos(angle)) ** 2 + (y - 0.080 * np.sin(angle)) ** 2 + (z - 0.018) ** 2)
        return away - 0.008 - 0.010 * np.cos(0.5 * np.pi * angle / _HALF_BOW_rad)

    return surface_of(distance, (0.030, -0.080, -0.003), (0.104, 0.081, 0.040))


_HALF_BOW_rad = float(np.deg2rad(55.0))

HOUSEHOLD: Mapping[str, Callable[[], trimesh.Trimesh]] = {
    "bottle": _bottle,
    "cup": _cup,
    "cup-with-handle": _cup_with_handle,
    "bowl": _bowl,
    "tin": _tin,
    "wedge": _wedge,
    "t-block": _t_block,
    "hammer": _hammer,
    "banana": _banana,
}
"""Our own models of everyday things."""
