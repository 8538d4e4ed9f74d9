"""A body that is open from above, as a cup: hollow within a wall of the same thickness everywhere.

Fingers that came down inside a rim tell that there is a cavity, but a model of what they touched closes it with a lid.
Contacts on the rim and inside tell how thick the wall is. Where no fingertip met the floor, it is assumed to be as
thick as the wall, and the less certain the less deep a finger was.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.posterior import Prediction
from tactile_lab.slam.shape.model import FittedShape
from tactile_lab.slam.shape.solids.rim import UPWARD, BELOW_m, Rim
from tactile_lab.slam.shape.solids.solid_field import SolidField
from tactile_lab.slam.shape.solids.walls import ON_SURFACE_m, THICKEST_m, Walls
from tactile_lab.slam.shape.surfaces.surface import Contour, Mask, SurfaceMesh, extract_mesh

_WITHIN_m = 0.008
"""A finger is in a cavity over what the model takes for solid so far from its sides: not beside a neck, over a
shoulder.
"""

_LOW = 0.25
"""Share of the height at which that is asked: a model has a dent of its own where rims lean inward."""

_BESIDE_rad, _BESIDE_m = float(np.deg2rad(30.0)), 0.025
"""A wall's outside tells of a place inside where its direction and height differ by less."""

_FINGER_m = 0.008
"""Fingertips outside a wall that leans over them come no nearer than that."""

_BEYOND_m = 0.005
"""Nothing of the body is so far outside of an outer wall."""

_RIM_WALL_m, _GRID_m = 0.008, 0.003
_THICKNESS_m, _LEAST_FLOOR_m = (0.004, THICKEST_m), 0.006
"""Of walls, none so thin that the grid misses it, and least thickness of the floor."""

_THICKNESS_SIGMA_m, _SIGMA_PER_DEPTH = 0.0015, 0.05
"""Where the wall's thickness was felt, and for each depth below."""


@dataclass(frozen=True)
class Hollow:
    """A body with a cavity; implements FittedShape. Made by :func:`hollowed`.

    Attributes:
        body: the model whose outside it has.
        outside: the body's surface.
        gpis: the field of all contacts.
        walls: of the outside.
        wall_m: their thickness.
        felt_m: lowest height at which it was felt, that of the rim where nothing was inside.
        entered_m: lowest height at which a finger was in the cavity.
        bottom_m, bottom_sigma_m: height at which the cavity ends, and its standard deviation.
        floor_m: height of the table.
    """

    body: FittedShape
    outside: SurfaceMesh
    gpis: Gpis
    walls: Walls
    wall_m: float
    felt_m: float
    entered_m: float
    bottom_m: float
    bottom_sigma_m: float
    floor_m: float

    @property
    def name(self) -> str:
        """Of the body, "hollow"."""
        return f"hollow {self.body.name}"

    @property
    def share_off(self) -> float:
        """Of the contacts, that are not on its surface."""
        return _off(self.field, self.gpis) / len(self.gpis.contacts_m)

    @property
    def log_evidence(self) -> float | None:
        """Of the body: no contact tells of the cavity."""
        return self.body.log_evidence

    def contour(self, resolution_m: float = 0.001) -> Contour:
        """Raises ShapeError: a solid has no outline."""
        raise ShapeError("contacts in space have a surface, not an outline", hint="Ask for the mesh")

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        """The surface, no coarser than walls allow, with its lining; it ends at the table for which it was made.

        Raises:
            ShapeError: nothing is inside.
        """
        mesh = extract_mesh(self.field, resolution_m=min(resolution_m, _GRID_m), floor_m=self.floor_m)
        return replace(mesh, lining=self.field.are_lining(mesh.vertices))

    @cached_property
    def field(self) -> _HollowField:
        """The body without the cavity, as a field."""
        return _HollowField(self)


class _HollowField:
    """The signed distance from a hollow body, near its surface."""

    sigma_inflation: float = 1.0
    """Predicted variances are those of surfaces already."""

    def __init__(self, shape: Hollow) -> None:
        mesh = shape.outside
        self._shape, self._body = shape, SolidField(mesh, mesh.sigma_m)
        self.contacts_m = np.vstack([shape.gpis.contacts_m, mesh.vertices[mesh.vertices.argmin(axis=0)]])

    def predict(self, points_m: Array, *, gradient: bool = False, variance: bool = False) -> Prediction:
        """The field at points of shape (q, 3)."""
        body = self._body.predict(points_m, gradient=gradient, variance=variance)
        cavity_m, is_wall, inward = self._cavity(points_m)
        inside = cavity_m > body.mean_m
        slope, variance_m2 = body.gradient, body.variance_m2
        if gradient:
            found = np.where(is_wall[:, None], inward, [0.0, 0.0, 1.0])
            slope = np.where(inside[:, None], found, slope)
        if variance:
            variance_m2 = np.where(inside, self._sigma_m(points_m[:, 2], is_wall) ** 2, variance_m2)
        return Prediction(np.where(inside, cavity_m, body.mean_m), slope, variance_m2)

    def are_lining(self, points_m: Array) -> Mask:
        """Which places of the surface, shape (q, 3), are on the inside of a wall, no deeper than a finger was."""
        cavity_m, is_wall, _ = self._cavity(points_m)
        is_inner = cavity_m > self._body.predict(points_m).mean_m
        return np.asarray(is_inner & is_wall & (points_m[:, 2] > self._shape.entered_m))

    def _cavity(self, points_m: Array) -> tuple[Array, Mask, Array]:
        """How far places (q, 3) are inside the cavity, whether its wall is nearer than its floor, and the directions
        away from the wall.
        """
        away_m, inward = self._shape.walls.away(points_m)
        to_wall_m, to_floor_m = away_m - self._shape.wall_m, points_m[:, 2] - self._shape.bottom_m
        is_wall = to_wall_m < to_floor_m
        return np.where(is_wall, to_wall_m, to_floor_m), is_wall, inward

    def _sigma_m(self, heights_m: Array, is_wall: Mask) -> Array:
        shape = self._shape
        wall_m = np.hypot(_THICKNESS_SIGMA_m, _SIGMA_PER_DEPTH * np.maximum(shape.felt_m - heights_m, 0.0))
        return np.where(is_wall, wall_m, shape.bottom_sigma_m)


def hollowed(
    shape: FittedShape, gpis: Gpis, free_points_m: Array | None, floor_m: float, inside: Mask | None = None
) -> FittedShape:
    """A shape with a cavity where fingers went down inside its rim; otherwise the shape itself.

    A lid and a cavity contradict one another: the one that less speaks against is believed, places where a finger came
    down through the lid, or contacts that the cavity leaves off the surface. Walls are those that face away from where
    fingers were: a model that was told of them may have a dent there, whose walls face them. The middle of the contacts
    on the rim need not be in that dent, as the rim may have been touched on one side alone.

    Args:
        shape: the most probable model.
        gpis: the field of all contacts.
        free_points_m: places that a finger went through, shape (k, 3), or None.
        floor_m: height of the table.
        inside: which contacts are on the inside (:func:`felt_inside`), if the model was made without them.

    Raises:
        ShapeError: the shape encloses nothing.
    """
    rim = Rim.of(gpis)
    if free_points_m is None or not rim.chosen.any():
        return shape
    low_m = free_points_m[rim.depths_m(free_points_m) > BELOW_m]
    if not len(low_m):
        return shape
    mesh = shape.mesh(_GRID_m, floor_m).below(float(gpis.contacts_m[:, 2].max()))
    body, walls = SolidField(mesh, 0.0), Walls.of(mesh)
    low_m = low_m[rim.surrounded(low_m, np.vstack([rim.contacts_m, _near_rim(walls, rim)]))]
    entered_m = low_m[_over_solid(low_m, body, floor_m + _LOW * (rim.top_m - floor_m))]
    if not len(entered_m):
        return shape
    inside = np.zeros_like(rim.chosen) if inside is None else inside
    hollow = _hollow(shape, mesh, gpis, _outer(walls, body, entered_m.mean(axis=0)), rim, inside, entered_m, floor_m)
    against = _off(hollow.field, gpis) - _off(body, gpis)
    return hollow if against < len(entered_m) else shape


def _hollow(
    shape: FittedShape,
    mesh: SurfaceMesh,
    gpis: Gpis,
    walls: Walls,
    rim: Rim,
    inside: Mask,
    entered_m: Array,
    floor_m: float,
) -> Hollow:
    """The body with a cavity between its walls, as thick and as deep as contacts on the rim and inside say."""
    faces_up, lowest_m = gpis.normals[:, 2] > UPWARD, float(entered_m[:, 2].min())
    on_wall_m, on_floor_m = gpis.contacts_m[inside & ~faces_up], gpis.contacts_m[inside & faces_up]
    wall_m = _thickness_m(walls, gpis.contacts_m[rim.chosen & ~inside], on_wall_m)
    felt_m = float(on_wall_m[:, 2].min(initial=rim.top_m))
    bottom = _bottom_m(on_floor_m[:, 2], wall_m, lowest_m, floor_m)
    return Hollow(shape, mesh, gpis, walls, wall_m, felt_m, lowest_m, *bottom, floor_m)


def are_entered(gpis: Gpis, free_points_m: Array) -> Mask:
    """Which places that a finger went through, shape (k, 3), are below a rim, with contacts on it around them, or no
    farther from such places than a fingertip's width inside the rim in their direction.
    """
    rim = Rim.of(gpis)
    entered = np.asarray(rim.depths_m(free_points_m) > BELOW_m)
    low_m = free_points_m[entered]
    inside = rim.surrounded(low_m, np.vstack([rim.highest_m, rim.beside_m]))
    if inside.any():
        inside |= rim.encloses(low_m, low_m[inside].mean(axis=0), _FINGER_m)
    entered[entered] = inside
    return entered


def felt_inside(gpis: Gpis, entered_m: Array) -> Mask:
    """Which contacts, shape (n,), are below a rim and inside: they face up, or where fingers came down inside it, shape
    (k, 3), and are nearer to there than the rim in their direction; or they face there, and are nearer than the outside
    of the wall at their height. Those on the near side of a handle face there, and those on a shoulder up, too.
    """
    points_m, rim, middle_m = gpis.contacts_m, Rim.of(gpis), entered_m.mean(axis=0)
    faces_middle = np.einsum("nk,nk->n", (middle_m - points_m)[:, :2], gpis.normals[:, :2]) > 0
    faces_up = gpis.normals[:, 2] > UPWARD
    outside_m = points_m[~(faces_middle | faces_up)]
    inside = (faces_middle | faces_up) & rim.encloses(points_m, middle_m)
    inside |= faces_middle & _behind(points_m, outside_m, rim, middle_m)
    return np.asarray(inside & (rim.depths_m(points_m) > BELOW_m))


def _behind(points_m: Array, outside_m: Array, rim: Rim, middle_m: Array) -> Mask:
    """Which places, shape (q, 3), are nearer to a middle than all those on the outside, shape (n, 3), that are beside
    them in direction and height; none where there is none.
    """
    away_m, out_m = ((rim.seen_m(each) - rim.seen_m(middle_m[None])) @ [1.0, 1.0j] for each in (points_m, outside_m))
    apart_m = np.abs(rim.depths_m(points_m)[:, None] - rim.depths_m(outside_m))
    beside = (np.abs(np.angle(away_m[:, None] * out_m.conj())) < _BESIDE_rad) & (apart_m < _BESIDE_m)
    nearest_m = np.where(beside, np.abs(out_m), np.inf).min(axis=1, initial=np.inf)
    return np.asarray(beside.any(axis=1) & (np.abs(away_m) < nearest_m))


def _outer(walls: Walls, body: SolidField, middle_m: Array) -> Walls:
    """Walls that face away from a middle, without those that have something of the body outside of them, as the sides
    of a bump on a lid have.
    """
    walls = walls.facing_away(middle_m)
    ways = (walls.middles_m - middle_m) * [1.0, 1.0, 0.0]
    outside_m = walls.middles_m + _BEYOND_m * ways / np.linalg.norm(ways, axis=1, keepdims=True)
    return walls.some(body.predict(outside_m).mean_m > 0)


def _thickness_m(walls: Walls, on_rim_m: Array, inside_m: Array) -> float:
    """Of a wall, by contacts on its rim, in the middle on average, and on its inside; shapes (q, 3), (k, 3)."""
    found_m = np.concatenate([2 * walls.distances_m(on_rim_m), walls.distances_m(inside_m)])
    return float(np.clip(np.median(found_m), *_THICKNESS_m))


def _bottom_m(felt_m: Array, wall_m: float, entered_m: float, floor_m: float) -> tuple[float, float]:
    """Height of the cavity's bottom, and its standard deviation: the lowest contact on it, heights of shape (n,), or as
    thick as the wall.
    """
    if len(felt_m):
        return float(felt_m.min()), _THICKNESS_SIGMA_m
    bottom_m = floor_m + max(wall_m, _LEAST_FLOOR_m)
    return bottom_m, max((entered_m - bottom_m) / 2, _THICKNESS_SIGMA_m)


def _near_rim(walls: Walls, rim: Rim) -> Array:
    """Middles of the triangles of walls close below the rim, shape (n, 3): it goes all around, though few places of it
    were touched.
    """
    depths_m = rim.depths_m(walls.middles_m)
    return walls.middles_m[(depths_m > 0) & (depths_m < _RIM_WALL_m)]


def _over_solid(places_m: Array, body: SolidField, height_m: float) -> Mask:
    """Over which places, shape (q, 3), a body is solid at a height, well inside its sides."""
    if not len(places_m):
        return np.zeros(0, dtype=bool)
    below_m = np.column_stack([places_m[:, :2], np.full(len(places_m), height_m)])
    return np.asarray(body.predict(below_m).mean_m < -_WITHIN_m)


def _off(field: SolidField | _HollowField, gpis: Gpis) -> int:
    """Number of contacts that are not on a surface."""
    return int(np.count_nonzero(np.abs(field.predict(gpis.contacts_m).mean_m) > ON_SURFACE_m))
