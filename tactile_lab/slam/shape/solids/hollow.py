"""A body that is open from above, as a cup: hollow within a wall of the same thickness everywhere.

Fingers that came down inside a rim tell that there is a cavity, but a model of what they touched closes it with a lid.
Contacts on the rim tell how thick the wall is. How deep the cavity is nobody touched: it is assumed to leave as much
for the floor, and both are the less certain the deeper they lie.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import Delaunay, QhullError

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.posterior import Prediction
from tactile_lab.slam.shape.model import FittedShape
from tactile_lab.slam.shape.solids.solid_field import SolidField
from tactile_lab.slam.shape.solids.walls import ON_SURFACE_m, THICKEST_m, Walls
from tactile_lab.slam.shape.surfaces.surface import Contour, Mask, SurfaceMesh, extract_mesh

_UPWARD = 0.7
"""Least vertical part of a normal on the rim."""

_RIM_m = 0.020
"""Contacts on the rim are no lower below the highest."""

_BELOW_RIM_m, _WITHIN_m = 0.004, 0.008
"""A finger is in a cavity so far below the rim, over what the model takes for solid so far from its sides: not beside a
neck, over a shoulder.
"""

_LOW = 0.25
"""Share of the height at which that is asked: a model has a dent of its own where rims lean inward."""

_ALIKE_rad = float(np.deg2rad(60.0))
"""A rim is about as far from its middle in directions that differ by less."""

_FINGER_m = 0.008
"""Fingertips outside a wall that leans over them come no nearer than that."""

_RIM_WALL_m, _GRID_m = 0.008, 0.003
_THICKNESS_m, _LEAST_FLOOR_m = (0.004, THICKEST_m), 0.006
"""Of walls, none so thin that the grid misses it, and least thickness of the floor."""

_THICKNESS_SIGMA_m, _SIGMA_PER_DEPTH = 0.0015, 0.05


@dataclass(frozen=True)
class Hollow:
    """A body with a cavity; implements FittedShape. Made by :func:`hollowed`.

    Attributes:
        body: the model whose outside it has.
        outside: the body's surface.
        gpis: the field of all contacts.
        middle_m: of the places where fingers were in the cavity, shape (3,).
        wall_m: thickness of the wall.
        rim_m: height of the rim.
        entered_m: lowest height at which a finger was in the cavity.
        floor_m: height of the table.
    """

    body: FittedShape
    outside: SurfaceMesh
    gpis: Gpis
    middle_m: Array
    wall_m: float
    rim_m: float
    entered_m: float
    floor_m: float

    @property
    def name(self) -> str:
        """Of the body, "hollow"."""
        return f"hollow {self.body.name}"

    @property
    def bottom_m(self) -> float:
        """Height at which the cavity ends."""
        return self.floor_m + max(self.wall_m, _LEAST_FLOOR_m)

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
        self._walls = Walls.of(mesh).facing_away(shape.middle_m)
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
        away_m, inward = self._walls.away(points_m)
        to_wall_m, to_floor_m = away_m - self._shape.wall_m, points_m[:, 2] - self._shape.bottom_m
        is_wall = to_wall_m < to_floor_m
        return np.where(is_wall, to_wall_m, to_floor_m), is_wall, inward

    def _sigma_m(self, heights_m: Array, is_wall: Mask) -> Array:
        shape = self._shape
        wall_m = np.hypot(_THICKNESS_SIGMA_m, _SIGMA_PER_DEPTH * np.maximum(shape.rim_m - heights_m, 0.0))
        floor_m = max((shape.entered_m - shape.bottom_m) / 2, _THICKNESS_SIGMA_m)
        return np.where(is_wall, wall_m, floor_m)


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
    rim = _on_rim(gpis)
    if free_points_m is None or not rim.any():
        return shape
    rim_m = float(gpis.contacts_m[rim, 2].max())
    low_m = free_points_m[free_points_m[:, 2] < rim_m - _BELOW_RIM_m]
    if not len(low_m):
        return shape
    mesh = shape.mesh(_GRID_m, floor_m).below(float(gpis.contacts_m[:, 2].max()))
    body, walls = SolidField(mesh, 0.0), Walls.of(mesh)
    low_m = low_m[_surrounded(low_m, np.vstack([gpis.contacts_m[rim], _near_rim(walls, rim_m)]))]
    entered_m = low_m[_over_solid(low_m, body, floor_m + _LOW * (rim_m - floor_m))]
    if not len(entered_m):
        return shape
    middle_m = entered_m.mean(axis=0)
    walls = walls.facing_away(middle_m)
    inside = np.zeros_like(rim) if inside is None else inside
    wall_m = _thickness_m(walls, gpis.contacts_m[rim & ~inside], gpis.contacts_m[inside])
    hollow = Hollow(shape, mesh, gpis, middle_m, wall_m, rim_m, float(entered_m[:, 2].min()), floor_m)
    against = _off(hollow.field, gpis) - _off(body, gpis)
    return hollow if against < len(entered_m) else shape


def are_entered(gpis: Gpis, free_points_m: Array) -> Mask:
    """Which places that a finger went through, shape (k, 3), are below a rim, with contacts on it around them, or no
    farther from such places than a fingertip's width inside the rim in their direction.
    """
    high_m = _highest(gpis)
    entered = np.asarray(free_points_m[:, 2] < high_m[:, 2].max(initial=-np.inf) - _BELOW_RIM_m)
    low_m = free_points_m[entered]
    inside = _surrounded(low_m, high_m)
    if inside.any():
        inside |= _within(low_m, high_m, low_m[inside].mean(axis=0), _FINGER_m)
    entered[entered] = inside
    return entered


def felt_inside(gpis: Gpis, entered_m: Array) -> Mask:
    """Which contacts, shape (n,), are below a rim and face up, or where fingers came down inside it, shape (k, 3), and
    are no farther from there than the rim in their direction: those on the near side of a handle face there, too.
    """
    points_m, high_m, middle_m = gpis.contacts_m, _highest(gpis), entered_m.mean(axis=0)
    facing = np.einsum("nk,nk->n", (middle_m - points_m)[:, :2], gpis.normals[:, :2]) > 0
    facing |= gpis.normals[:, 2] > _UPWARD
    is_low = points_m[:, 2] < high_m[:, 2].max() - _BELOW_RIM_m
    return np.asarray(facing & is_low & _within(points_m, high_m, middle_m))


def _within(places_m: Array, rim_m: Array, middle_m: Array, by_m: float = 0.0) -> Mask:
    """Which places, seen from above, are nearer to a middle than the rim in their direction, shapes (q, 3), (n, 3) and
    (3,); none where the rim is not known in about that direction.
    """
    away_m, around_m = ((each - middle_m)[:, :2] @ [1.0, 1.0j] for each in (places_m, rim_m))
    is_known = (np.abs(np.angle(away_m[:, None] * around_m.conj())) < _ALIKE_rad).any(axis=1)
    there_m = np.interp(np.angle(away_m), np.angle(around_m), np.abs(around_m), period=2 * np.pi)
    return np.asarray(is_known & (np.abs(away_m) < there_m - by_m))


def _highest(gpis: Gpis) -> Array:
    """The contacts on the rim that are no lower below the highest than fingers must be to be inside, shape (k, 3)."""
    rim_m = gpis.contacts_m[_on_rim(gpis)]
    return np.asarray(rim_m[rim_m[:, 2] > rim_m[:, 2].max(initial=-np.inf) - 2 * _BELOW_RIM_m])


def _thickness_m(walls: Walls, on_rim_m: Array, inside_m: Array) -> float:
    """Of a wall, by contacts on its rim, in the middle on average, and on its inside; shapes (q, 3), (k, 3)."""
    found_m = np.concatenate([2 * walls.distances_m(on_rim_m), walls.distances_m(inside_m)])
    return float(np.clip(np.median(found_m), *_THICKNESS_m))


def _on_rim(gpis: Gpis) -> Mask:
    """Which contacts face up and are among the highest, shape (n,)."""
    heights_m = gpis.contacts_m[:, 2]
    return np.asarray((gpis.normals[:, 2] > _UPWARD) & (heights_m > heights_m.max() - _RIM_m))


def _near_rim(walls: Walls, rim_m: float) -> Array:
    """Middles of the triangles of walls close below the rim, shape (n, 3): it goes all around, though few places of it
    were touched.
    """
    middles_m = walls.middles_m
    return middles_m[(middles_m[:, 2] < rim_m) & (middles_m[:, 2] > rim_m - _RIM_WALL_m)]


def _over_solid(places_m: Array, body: SolidField, height_m: float) -> Mask:
    """Over which places, shape (q, 3), a body is solid at a height, well inside its sides."""
    if not len(places_m):
        return np.zeros(0, dtype=bool)
    below_m = np.column_stack([places_m[:, :2], np.full(len(places_m), height_m)])
    return np.asarray(body.predict(below_m).mean_m < -_WITHIN_m)


def _off(field: SolidField | _HollowField, gpis: Gpis) -> int:
    """Number of contacts that are not on a surface."""
    return int(np.count_nonzero(np.abs(field.predict(gpis.contacts_m).mean_m) > ON_SURFACE_m))


def _surrounded(places_m: Array, around_m: Array) -> Mask:
    """Which places, seen from above, others surround; shapes (q, 3), (n, 3)."""
    try:
        return np.asarray(Delaunay(around_m[:, :2]).find_simplex(places_m[:, :2]) >= 0)
    except (QhullError, ValueError):  # they are in a line, or none
        return np.zeros(len(places_m), dtype=bool)
