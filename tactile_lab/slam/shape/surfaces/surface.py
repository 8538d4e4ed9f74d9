"""The zero level of a field as a contour (in the plane) or a mesh (in space), with its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.field_grid import FieldGrid, SurfaceField
from tactile_lab.slam.shape.surfaces.level_sets import level_mesh, level_outlines
from tactile_lab.slam.shape.surfaces.sampling import polygon_area

Indices: TypeAlias = NDArray[np.int64]
Mask: TypeAlias = NDArray[np.bool_]

FIRST_MARGIN_m = 0.015
_NEWTON_STEPS = 2
_FLAT = 1e-3
"""A vertex within this distance of the floor or ceiling, in grid spacings, is part of the flat end."""
_RIM_STEPS, _LARGEST_RIM_STEP, _FLATTEST_WALL = 4, 1.7, 0.3
LEVEL_SIGMA_m = 0.0002
"""Standard deviation of the height of a flat end: the table, or a level determined by many contacts."""
RESOLUTION_m = 0.001
"""Of a fingertip. Where a surface is fitted to another, standard deviations far below it count alike, so that no part
is fitted for its own sake, and guesses count little.
"""
_FLATTEST_SLOPE = 1e-3
"""Below this slope the field does not determine its surface; sigma is then computed with this slope."""


@dataclass(frozen=True)
class Contour:
    """A simple closed polygon, counter-clockwise; the last point joins the first.

    Attributes:
        points_m: shape (n, 2), metres.
        sigma_m: shape (n,), standard deviation of the contour along its normal.
        is_closed: False if the field has no closed outline and was cut at the largest margin.
        known: of each point, whether it was touched nearby, shape (n,); None if that was not determined.
        shared_sigma_m: median of the part of sigma that contacts of one finger share: the same throughout a session.
    """

    points_m: Array
    sigma_m: Array
    is_closed: bool
    known: Mask | None = None
    shared_sigma_m: float = 0.0

    @property
    def normals(self) -> Array:
        """Outward unit normals at the points, half way between those of both sides, shape (n, 2)."""
        edges = np.roll(self.points_m, -1, axis=0) - self.points_m
        outward = np.column_stack([edges[:, 1], -edges[:, 0]])  # counter-clockwise
        both = outward + np.roll(outward, 1, axis=0)
        return np.asarray(both / np.maximum(np.linalg.norm(both, axis=1, keepdims=True), 1e-12))


@dataclass(frozen=True)
class SurfaceMesh:
    """A watertight triangle mesh, faces counter-clockwise seen from outside.

    Attributes:
        vertices: shape (n, 3), metres.
        faces: shape (m, 3), vertex indices.
        sigma_m: shape (n,), standard deviation of the surface along its normal.
        normals: shape (n, 3), outward unit normals at the vertices.
        is_closed: False if the field has no closed surface and was cut at the largest margin.
        known: of each vertex, whether it was touched nearby, shape (n,); None if that was not determined.
        shared_sigma_m: median of the part of sigma that contacts of one finger share: the same throughout a session.
        lining: of each vertex, whether it is the inside of a wall of which the rim tells how thick it is, and where a
            finger was as deep, shape (n,); None without such a wall.
    """

    vertices: Array
    faces: Indices
    sigma_m: Array
    normals: Array
    is_closed: bool
    known: Mask | None = None
    shared_sigma_m: float = 0.0
    lining: Mask | None = None

    def below(self, top_m: float) -> SurfaceMesh:
        """The surface with what is higher than ``top_m`` pressed down to there."""
        return self._levelled(self.vertices[:, 2] > top_m, top_m, 1.0)

    def above(self, floor_m: float) -> SurfaceMesh:
        """The surface with what is lower than ``floor_m`` pressed up to there."""
        return self._levelled(self.vertices[:, 2] < floor_m, floor_m, -1.0)

    def _levelled(self, chosen: Mask, height_m: float, up: float) -> SurfaceMesh:
        heights_m = np.where(chosen, height_m, self.vertices[:, 2])
        vertices = np.column_stack([self.vertices[:, :2], heights_m])
        return replace(self, vertices=vertices, normals=np.where(chosen[:, None], [0.0, 0.0, up], self.normals))


def extract_contour(field: SurfaceField, *, resolution_m: float = 0.001, largest_margin_m: float = 0.060) -> Contour:
    """The outline of the object in a planar field.

    Args:
        field: a field fitted in two dimensions.
        resolution_m: spacing of the grid on which the outline is found, before it is refined to the zero level.
        largest_margin_m: the grid is extended around the contacts until the outline is closed, at most by this.

    Raises:
        ShapeError: no point near the contacts is inside, or the grid would be too large.
    """
    solid = _solid(field, resolution_m, largest_margin_m)
    places = max(level_outlines(solid.values_m), key=lambda loop: abs(polygon_area(loop)))
    points, _, sigma = _refine(field, solid.lower_m + resolution_m * places, resolution_m)
    return _counter_clockwise(Contour(points, sigma, solid.is_closed))


def extract_mesh(
    field: SurfaceField,
    *,
    resolution_m: float = 0.003,
    largest_margin_m: float = 0.060,
    floor_m: float | None = None,
    ceiling_m: float | None = None,
) -> SurfaceMesh:
    """The object's surface in a spatial field, by marching cubes; arguments and errors as :func:`extract_contour`.

    ``floor_m`` is the height of the table on which the object stands, if any: the surface ends there in a flat foot,
    even if the field continues below. ``ceiling_m`` likewise is the height of a flat top, if any. Both ends have sharp
    rims, and their sigma is :data:`LEVEL_SIGMA_m`.
    """
    solid = _solid(field, resolution_m, largest_margin_m).between(floor_m, ceiling_m, resolution_m)
    places, faces = level_mesh(solid.values_m)
    rough = solid.lower_m + resolution_m * places
    vertices, normals, sigma = _refine(field, rough, resolution_m)
    for level_m, side in ((floor_m, -1.0), (ceiling_m, 1.0)):
        if level_m is not None:
            flat = side * rough[:, 2] > side * level_m - _FLAT * resolution_m
            vertices = _level(vertices, rough, flat, level_m, side)
            rim = flat & np.isin(np.arange(len(flat)), faces[~flat[faces].all(axis=1)])
            vertices[rim] = _move_sideways(field, vertices[rim], _LARGEST_RIM_STEP * resolution_m)
            normals[flat], sigma[flat] = [0.0, 0.0, side], LEVEL_SIGMA_m
    return SurfaceMesh(vertices, faces, sigma, normals, solid.is_closed)


@dataclass(frozen=True)
class _Solid:
    """Node values of one body without cavities, surrounded by positive nodes on all sides."""

    lower_m: Array
    values_m: Array
    is_closed: bool

    def between(self, floor_m: float | None, ceiling_m: float | None, spacing_m: float) -> _Solid:
        """The same body without the parts below or above given heights. Raises ShapeError if nothing is left."""
        heights = self.lower_m[2] + spacing_m * np.arange(self.values_m.shape[2])
        below = -np.inf if floor_m is None else floor_m - heights
        above = -np.inf if ceiling_m is None else heights - ceiling_m
        values = np.maximum(self.values_m, np.maximum(below, above))
        if not (values < 0).any():
            raise ShapeError("the whole shape lies below the table", hint="Check the units and the contacts' heights")
        return replace(self, values_m=values)


def _level(vertices: Array, rough: Array, flat: Mask, level_m: float, side: float) -> Array:
    """Put vertices of a flat end exactly at its level; no other vertex may be beyond it."""
    levelled = np.where(flat[:, None], rough, vertices)
    levelled[:, 2] = side * np.minimum(side * levelled[:, 2], side * level_m)
    return levelled


def _move_sideways(field: SurfaceField, points_m: Array, reach_m: float) -> Array:
    """Move points horizontally onto the zero level, so that a flat end meets the walls in a sharp rim.

    A point that would move farther than ``reach_m``, because the field has no wall there, stays.
    """
    moved = points_m.copy()
    for _ in range(_RIM_STEPS):
        found = field.predict(moved, gradient=True)
        level = found.gradient[:, :2]
        moved[:, :2] -= (found.mean_m / np.maximum(np.sum(level**2, axis=1), _FLATTEST_WALL**2))[:, None] * level
    near = np.linalg.norm(moved - points_m, axis=1) < reach_m
    return np.where(near[:, None], moved, points_m)


def _solid(field: SurfaceField, resolution_m: float, largest_margin_m: float) -> _Solid:
    """Tabulate the field around the contacts, and farther on sides where the object continues."""
    contacts = field.contacts_m
    margins = np.full((2, contacts.shape[1]), min(FIRST_MARGIN_m, largest_margin_m))
    while True:
        lower, upper = contacts.min(axis=0) - margins[0], contacts.max(axis=0) + margins[1]
        grid = FieldGrid.tabulate(field, lower, upper, resolution_m)
        body = _body(grid, contacts)
        open_sides = _touched_sides(body)
        growing = open_sides & (margins < largest_margin_m)
        if not growing.any():
            return _pad(grid, body, is_closed=not open_sides.any())
        margins = np.where(growing, np.minimum(2 * margins, largest_margin_m), margins)


def _body(grid: FieldGrid, contacts_m: Array) -> Mask:
    """The connected inside region nearest to most contacts, with its cavities filled."""
    labels, _ = ndimage.label(grid.values_m < 0)
    inside = np.argwhere(labels)
    if len(inside) == 0:
        raise ShapeError("the field has no inside near the contacts", hint="Choose a finer resolution or more contacts")
    _, nearest = cKDTree(inside).query((contacts_m - grid.lower_m) / grid.spacing_m)
    votes = np.bincount(labels[tuple(inside[nearest].T)])
    return np.asarray(ndimage.binary_fill_holes(labels == votes.argmax()))


def _touched_sides(body: Mask) -> Mask:
    """Whether the body reaches the first and the last layer of nodes along each axis, shape (2, d)."""
    axes = range(body.ndim)
    return np.array([[np.take(body, layer, axis=axis).any() for axis in axes] for layer in (0, -1)])


def _pad(grid: FieldGrid, body: Mask, *, is_closed: bool) -> _Solid:
    """Values whose signs distinguish the body from the rest, with a positive layer around them."""
    size = np.maximum(np.abs(grid.values_m), 1e-6 * grid.spacing_m)
    values = np.pad(np.where(body, -size, size), 1, constant_values=grid.spacing_m)
    return _Solid(grid.lower_m - grid.spacing_m, values, is_closed)


def _refine(field: SurfaceField, points_m: Array, reach_m: float) -> tuple[Array, Array, Array]:
    """Move points onto the zero level by Newton steps; returns them with outward normals and standard deviations.

    A point that would move farther than ``reach_m`` stays: it lies on a cut or on a filled cavity.
    """
    for _ in range(_NEWTON_STEPS):
        found = field.predict(points_m, gradient=True)
        slope = slope_of(found.gradient)
        steps = (found.mean_m / slope**2)[:, None] * found.gradient
        is_near = np.linalg.norm(steps, axis=1) < reach_m
        points_m = points_m - np.where(is_near[:, None], steps, 0.0)
    found = field.predict(points_m, gradient=True, variance=True)
    slope = slope_of(found.gradient)
    sigma = field.sigma_inflation * np.sqrt(found.variance_m2) / slope
    return points_m, found.gradient / slope[:, None], sigma


def slope_of(gradient: Array) -> Array:
    """Slope of a field from its gradient, shapes (q, d) and (q,), at least what determines a surface."""
    return np.asarray(np.maximum(np.linalg.norm(gradient, axis=1), _FLATTEST_SLOPE))


def _counter_clockwise(contour: Contour) -> Contour:
    if polygon_area(contour.points_m) > 0:
        return contour
    return Contour(contour.points_m[::-1].copy(), contour.sigma_m[::-1].copy(), contour.is_closed)


def supported_pieces(contour: Contour, largest_sigma_m: float) -> list[Contour]:
    """The parts of an outline with sigma up to ``largest_sigma_m``, in order, as open lines.

    One unchanged piece if that is the whole outline; none if no part qualifies.
    """
    good = contour.sigma_m <= largest_sigma_m
    if good.all():
        return [contour]
    opening = int(np.argmin(good))  # start at a gap, so that no piece is split at the end of the arrays
    order = np.roll(np.arange(len(good)), -opening)
    starts = np.flatnonzero(good[order] & ~good[np.roll(order, 1)])
    ends = np.flatnonzero(good[order] & ~good[np.roll(order, -1)])
    rows = [order[start : end + 1] for start, end in zip(starts, ends, strict=True)]
    return [Contour(contour.points_m[row], contour.sigma_m[row], is_closed=False) for row in rows]


def supported_mesh(mesh: SurfaceMesh, largest_sigma_m: float) -> SurfaceMesh:
    """The faces of a surface whose vertices all have sigma up to ``largest_sigma_m``; open where it is cut."""
    good = mesh.sigma_m <= largest_sigma_m
    if good.all():
        return mesh
    faces = mesh.faces[good[mesh.faces].all(axis=1)]
    used = np.unique(faces)
    renumbered = np.zeros(len(good), dtype=np.int64)
    renumbered[used] = np.arange(len(used))
    return SurfaceMesh(mesh.vertices[used], renumbered[faces], mesh.sigma_m[used], mesh.normals[used], False)
