"""The objects of the simulated rig: collision shapes for the physics, and true surfaces for the evaluation.

The object frame has its origin at the centre of volume and z up in the resting pose; each builder states the other
axes. It is the frame of the physics body, and ``world_T_object`` of the truth channel refers to it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np
import trimesh
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.simulation.mesh_object import load_resting_mesh
from drivers.simulation.object_names import MESH_PREFIX
from drivers.simulation.skin import skin

_CURVE_SEGMENTS = 64  # chord error 0.06 mm on the largest curve
_SPHERE_SUBDIVISIONS = 4  # 0.03 mm on a 35 mm sphere
_FOOT_LAYER_m = 0.003  # vertices this close above the lowest one belong to a scanned object's underside
MARKER_SIDE_m = 0.035
"""Side of the object marker if the underside is large enough."""

QUIET_ZONE = 7 / 6
"""Ratio of the printed square to the black one: half a module of white on every side."""

_SMALLEST_MARKER_m = 0.012
_INWARD = 0.999
"""Of the largest that fits: what is nearer to the middle may be so much smaller."""


@dataclass(frozen=True)
class Solid:
    """A convex piece that is a primitive of the physics engine.

    Attributes:
        kind: ``box`` (half sizes), ``cylinder`` (radius, half height) or ``sphere`` (radius).
        size_m: the sizes named above.
        position_object_m: centre of the piece in the object frame.
    """

    kind: Literal["box", "cylinder", "sphere"]
    size_m: tuple[float, ...]
    position_object_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Hull:
    """A convex piece as the hull of points, shape (n, 3), object frame, metres."""

    vertices_object_m: Array


Piece: TypeAlias = Solid | Hull


@dataclass(frozen=True)
class UndersideMarker:
    """The position of the ArUco marker on the underside.

    Attributes:
        side_m: side of the black square.
        centre_object_m: its centre in the object frame. Seen from below, the marker's x is the object's x and its y
            the object's -y.
    """

    side_m: float
    centre_object_m: tuple[float, float, float]


@dataclass(frozen=True)
class ObjectModel:
    """One object of the simulated rig.

    Attributes:
        name: name in the catalogue, or ``mesh:<path>``.
        pieces: convex pieces that the hand touches; without a hull they are solid, and stand on the table.
        mesh: watertight truth surface in the object frame, metres.
        foot_object_m: polygon of the underside, shape (n, 2), which the camera sees as a dark area.
        marker: the marker on the underside.
        rolls: whether the object can roll, so that the contact model needs rolling friction.
        scanned: whether the underside is as uneven as a scan, so that the physics must settle it into its resting pose.
        hull: on which an object stands whose pieces are only a skin; None for another.
        changes: what was done to the mesh of a file, as sentences.
    """

    name: str
    pieces: tuple[Piece, ...]
    mesh: trimesh.Trimesh
    foot_object_m: Array
    marker: UndersideMarker
    rolls: bool = False
    scanned: bool = False
    hull: Hull | None = None
    changes: tuple[str, ...] = ()

    @property
    def height_m(self) -> float:
        """Height of the object in its resting pose."""
        return float(self.mesh.bounds[1, 2] - self.mesh.bounds[0, 2])

    @property
    def rest_height_m(self) -> float:
        """Height of the object frame's origin above the table in the resting pose."""
        return float(-self.mesh.bounds[0, 2])


def object_model(name: str) -> ObjectModel:
    """The object named ``name``: one of :data:`CATALOGUE`, or ``mesh:<path>`` for a watertight mesh in metres.

    The name of a mesh may end with a resting pose (:func:`drivers.simulation.object_names.in_pose`).

    Raises:
        ConfigurationError: there is no such object, or the mesh file cannot be used.
    """
    if name.startswith(MESH_PREFIX):
        return _scan(name)
    check_object(name)
    return CATALOGUE[name](name)


def check_object(name: str) -> None:
    """Raises ConfigurationError unless there is an object of this name whose mesh, if any, can be used."""
    object_height_m(name)


def object_height_m(name: str) -> float:
    """Height of an object in its resting pose, found without its convex pieces.

    Raises:
        ConfigurationError: there is no such object, or the mesh file cannot be used.
    """
    if name.startswith(MESH_PREFIX):
        return float(load_resting_mesh(name).mesh.extents[2])
    if name not in CATALOGUE:
        known = ", ".join([*CATALOGUE, f"{MESH_PREFIX}<path>"])
        raise ConfigurationError(f"there is no object {name!r}", where="object", hint=f"Available objects: {known}")
    return CATALOGUE[name](name).height_m


def prism_mesh(outline_m: Array, height_m: float) -> trimesh.Trimesh:
    """Closed prism over an outline, centred in z.

    Args:
        outline_m: counter-clockwise polygon, shape (n, 2), star-shaped about its first vertex.
        height_m: height along z.
    """
    n = len(outline_m)
    low, high = (np.column_stack([outline_m, np.full(n, z)]) for z in (-height_m / 2, height_m / 2))
    following = np.roll(np.arange(n), -1)
    fan = np.column_stack([np.zeros(n - 2, int), np.arange(1, n - 1), np.arange(2, n)])
    sides = np.column_stack([np.arange(n), following, following + n])
    sides_upper = np.column_stack([np.arange(n), following + n, np.arange(n) + n])
    faces = np.vstack([fan[:, ::-1], fan + n, sides, sides_upper])
    return trimesh.Trimesh(np.vstack([low, high]), faces, process=False)


def _prism(
    name: str, outline_m: Array, height_m: float, pieces: tuple[Piece, ...], marker_xy_m: tuple[float, float] = (0, 0)
) -> ObjectModel:
    marker = UndersideMarker(MARKER_SIDE_m, (*marker_xy_m, -height_m / 2))
    mesh = prism_mesh(outline_m, height_m)
    return ObjectModel(name, pieces, mesh, outline_m, marker)


def _box(length_m: float, width_m: float, height_m: float) -> Callable[[str], ObjectModel]:
    """x along the first size, y along the second."""
    half = (length_m / 2, width_m / 2, height_m / 2)
    outline = np.array([[-half[0], -half[1]], [half[0], -half[1]], [half[0], half[1]], [-half[0], half[1]]])
    return lambda name: _prism(name, outline, height_m, (Solid("box", half),))


def _ring(semi_x_m: float, semi_y_m: float, corners: int, first_rad: float = 0.0) -> Array:
    angles = first_rad + 2 * np.pi * np.arange(corners) / corners
    return np.column_stack([semi_x_m * np.cos(angles), semi_y_m * np.sin(angles)])


def _convex_prism(outline_m: Array, height_m: float, marker_y_m: float = 0.0) -> Callable[[str], ObjectModel]:
    vertices = np.vstack([np.column_stack([outline_m, np.full(len(outline_m), s * height_m / 2)]) for s in (-1, 1)])
    return lambda name: _prism(name, outline_m, height_m, (Hull(vertices),), (0.0, marker_y_m))


def _l_block(name: str) -> ObjectModel:
    """100 x 80 x 50 mm with legs 40 mm wide: the long leg along x at the low-y side, the short one along y at low x."""
    corners = np.array([[-10, 5], [-10, 45], [-50, 45], [-50, -35], [50, -35], [50, 5]]) * 1e-3  # inner corner first
    centroid = np.array([-48.0, -20.0]) * 1e-3 / 5.6  # of the 100 x 40 and 40 x 40 rectangles
    long_leg = tuple(np.array([0.0, -0.015]) - centroid)
    short_leg = tuple(np.array([-0.030, 0.025]) - centroid)
    pieces = (
        Solid("box", (0.050, 0.020, 0.025), (*long_leg, 0.0)),
        Solid("box", (0.020, 0.020, 0.025), (*short_leg, 0.0)),
    )
    marker_xy = tuple(np.array([-0.0295, -0.0145]) - centroid)  # in the legs' corner, where the foot is widest
    return _prism(name, corners - centroid, 0.050, pieces, (float(marker_xy[0]), float(marker_xy[1])))


def _cylinder(name: str) -> ObjectModel:
    """Radius 32 mm, standing, 60 mm high."""
    radius, height = 0.032, 0.060
    outline = _ring(radius, radius, _CURVE_SEGMENTS)
    model = _prism(name, outline, height, (Solid("cylinder", (radius, height / 2)),))
    return replace(model, rolls=True)


def _sphere(name: str) -> ObjectModel:
    """Radius 35 mm. Its marker is a 20 mm square on a small flat at the lowest point, visible until the sphere
    rolls.
    """
    radius = 0.035
    mesh = trimesh.creation.icosphere(subdivisions=_SPHERE_SUBDIVISIONS, radius=radius)
    foot = _ring(0.4 * radius, 0.4 * radius, _CURVE_SEGMENTS)
    marker = UndersideMarker(0.020, (0.0, 0.0, -radius))
    return ObjectModel(name, (Solid("sphere", (radius,)),), mesh, foot, marker, rolls=True)


def _scan(name: str) -> ObjectModel:
    """A mesh from a file: origin at the centre of volume; axes as in the file, except for the rotation that makes it
    stand.
    """
    loaded = load_resting_mesh(name)
    mesh = loaded.mesh
    hull = Hull(np.asarray(mesh.convex_hull.vertices, float))
    lowest = mesh.bounds[0, 2]
    near_table = mesh.vertices[mesh.vertices[:, 2] < lowest + _FOOT_LAYER_m, :2]
    foot = _convex_outline(near_table)
    marker = _largest_marker(foot, lowest)
    return ObjectModel(
        name,
        tuple(map(Hull, skin(mesh))),
        mesh,
        foot,
        marker,
        rolls=True,
        scanned=True,
        hull=hull,
        changes=loaded.changes,
    )


def _convex_outline(points_m: Array) -> Array:
    """Convex hull of points of shape (n, 2), counter-clockwise."""
    return np.asarray(points_m[ConvexHull(points_m).vertices])


def _largest_marker(foot_m: Array, height_m: float) -> UndersideMarker:
    """The largest marker along the object's axes that fits, with its border, into the underside, as near to the
    underside's middle as it fits.
    """
    sides = np.asarray(ConvexHull(foot_m).equations)  # inside: normal . x + offset <= 0
    toward_corner = np.abs(sides[:, :2]).sum(axis=1)  # of a square along the axes, per half side
    constraints = np.column_stack([sides[:, :2], toward_corner])
    best = linprog([0, 0, -1], A_ub=constraints, b_ub=-sides[:, 2], bounds=[(None, None), (None, None), (0, None)])
    half_m = _INWARD * min(float(np.asarray(best.x)[2]), MARKER_SIDE_m * QUIET_ZONE / 2)
    x, y = _nearest_inside(sides, half_m * toward_corner, (foot_m.min(axis=0) + foot_m.max(axis=0)) / 2)
    side = float(np.clip(2 * half_m / QUIET_ZONE / _INWARD, _SMALLEST_MARKER_m, MARKER_SIDE_m))
    return UndersideMarker(side, (x, y, float(height_m)))


def _nearest_inside(sides: Array, inward_m: Array, wanted_m: Array) -> tuple[float, float]:
    """The place nearest to another (by the sum of both coordinates) that is so far, (n,), inside a polygon's sides."""
    unit = np.eye(2)
    inside = np.hstack([sides[:, :2], np.zeros((len(sides), 2))])
    beyond = np.vstack([np.hstack([unit, -unit]), np.hstack([-unit, -unit])])  # |place - wanted| is the cost
    bounds = [(None, None)] * 2 + [(0, None)] * 2
    limits = np.concatenate([-sides[:, 2] - inward_m, wanted_m, -wanted_m])
    best = linprog([0, 0, 1, 1], A_ub=np.vstack([inside, beyond]), b_ub=limits, bounds=bounds)
    x, y, *_ = np.asarray(best.x).tolist()
    return float(x), float(y)


CATALOGUE: Mapping[str, Callable[[str], ObjectModel]] = {
    "box-10x6x4": _box(0.100, 0.060, 0.040),
    "box-12x6x6": _box(0.120, 0.060, 0.060),
    "cube-6": _box(0.060, 0.060, 0.060),
    "triangular-prism": _convex_prism(_ring(0.055, 0.055, 3, np.pi / 2), 0.050, marker_y_m=-0.002),
    "hexagonal-prism": _convex_prism(_ring(0.042, 0.042, 6), 0.050),
    "elliptic-cylinder": _convex_prism(_ring(0.050, 0.030, _CURVE_SEGMENTS), 0.050),
    "l-block": _l_block,
    "cylinder": _cylinder,
    "sphere": _sphere,
}
"""Names of the built-in objects and their builders. The first corner of the triangular prism is on +y; that of the
hexagonal prism and the major axis of the ellipse are on +x.
"""
