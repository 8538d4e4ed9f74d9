"""A prism: vertical walls over any outline, between two heights, and a level top.

Contacts at all heights belong to one outline, whose model (smooth field or straight faces) is chosen as in the plane.
Most things that stand on a table are prisms, and for these the walls are determined far better.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.model import FittedShape
from tactile_lab.slam.shape.solids.extent import field_end
from tactile_lab.slam.shape.solids.mesh import FacetMesh, Indices, area_weighted_normals, refine
from tactile_lab.slam.shape.solids.planes import WeightedContacts
from tactile_lab.slam.shape.solids.polyhedron import contacts_of
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

_LEVEL_COSINE = np.sqrt(0.5)
"""A contact whose normal points up by more than this is on the top."""
_LEAST_WALL_CONTACTS = 6
_FLAT_EAR = 1e-7
"""An ear counts as flat if twice its area is below this share of the squared extent of the polygon."""
_CORNER_TURN = 0.15
_FOOT_SIGMA_m = 1e-4
_VERTEX_SPACING = 2.0


@dataclass(frozen=True)
class Level:
    """A horizontal end of a prism.

    Attributes:
        height_m: along the third axis.
        sigma_m: standard deviation of the height.
        log_likelihood: log likelihood of the contacts on it, with the BIC penalty for the height.
    """

    height_m: float
    sigma_m: float
    log_likelihood: float


class Prism:
    """An outline between two heights; implements FittedShape. Made by :meth:`fit`.

    Attributes:
        name: "prism".
        outline: model of the horizontal section.
        top, bottom: the levels at which it ends, taken from the field if no contact is on them; a bottom above the
            table is replaced by the table.
        log_evidence: that of the outline, plus that of vertical walls and level ends.
    """

    name = "prism"

    def __init__(self, outline: FittedShape, top: _End, bottom: _End, log_evidence: float) -> None:
        self.outline, self._top, self._bottom, self.log_evidence = outline, top, bottom, log_evidence

    @property
    def top(self) -> Level:
        """Raises ShapeError if it was not touched and the field has no inside."""
        return self._top.level

    @property
    def bottom(self) -> Level:
        """Raises ShapeError if it was not touched and the field has no inside."""
        return self._bottom.level

    @classmethod
    def fit(
        cls, gpis: Gpis, best_outline: Callable[[Gpis, Array | None], FittedShape], free_points_m: Array | None = None
    ) -> Self:
        """Fit walls and ends to the contacts of a field, which bounds the prism at untouched ends.

        Args:
            gpis: a field fitted in space.
            best_outline: chooses the model for contacts in the plane, given free places or None.
            free_points_m: places that a finger went through, shape (k, 3), or None.

        Raises:
            ShapeError: there are too few contacts on walls, or the outline has no evidence.
        """
        contacts = contacts_of(gpis)
        up = contacts.normals[:, 2]
        walls = np.flatnonzero(on_walls(contacts.normals))
        if len(walls) < _LEAST_WALL_CONTACTS:
            raise ShapeError(f"{len(walls)} contacts on walls are too few for an outline")
        top, bottom = [_End(gpis, side, np.flatnonzero(side * up > _LEVEL_COSINE)) for side in (1.0, -1.0)]
        free = _beside(free_points_m, top, bottom)
        outline = best_outline(_planar_field(gpis, contacts, walls), free)
        if outline.log_evidence is None:
            raise ShapeError("the outline's model has no evidence to compare")
        tilt_weights = contacts.normal_weights[walls]
        upright = -0.5 * np.sum(tilt_weights * up[walls] ** 2) + _scale(tilt_weights)
        evidence = outline.log_evidence + upright + top.log_likelihood + bottom.log_likelihood
        return cls(outline, top, bottom, float(evidence))

    @cached_property
    def section(self) -> Contour:
        """The horizontal section."""
        return self.outline.contour()

    def contour(self, resolution_m: float = 0.001) -> Contour:
        """Raises ShapeError: a solid has no outline."""
        raise ShapeError("contacts in space have a surface, not an outline", hint="Ask for the mesh")

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        """The surface, watertight, its vertices at most twice ``resolution_m`` apart.

        Raises:
            ShapeError: the outline encloses nothing, or the table lies above the top.
        """
        bottom = self.bottom if floor_m is None else Level(floor_m, _FOOT_SIGMA_m, 0.0)
        if bottom.height_m >= self.top.height_m:
            raise ShapeError("the whole shape lies below the table", hint="Check the units and the contacts' heights")
        ring, ring_sigma = _thin(self.section, resolution_m)
        rough = _extrude(ring, bottom.height_m, self.top.height_m)
        fine = refine(rough, _VERTEX_SPACING * resolution_m)
        wall_sigma = _nearest(fine.vertices_m[:, :2], ring, ring_sigma)
        sigma = self._sigma(fine, wall_sigma, bottom.sigma_m)
        return SurfaceMesh(fine.vertices_m, fine.triangles, sigma, area_weighted_normals(fine), is_closed=True)

    def _sigma(self, mesh: FacetMesh, wall_sigma_m: Array, bottom_sigma_m: float) -> Array:
        """The largest sigma of the parts that meet at each vertex."""
        sigma = np.zeros(len(mesh.vertices_m))
        level = np.ones(len(sigma))
        for part, here in enumerate((wall_sigma_m, self.top.sigma_m * level, bottom_sigma_m * level)):
            touched = np.unique(mesh.triangles[mesh.planes == part])
            sigma[touched] = np.maximum(sigma[touched], here[touched])
        return sigma


def on_walls(normals: Array) -> NDArray[np.bool_]:
    """Whether contacts with these normals, shape (n, 3), are on the walls of a prism and not on its ends."""
    return np.asarray(np.abs(normals[:, 2]) <= _LEVEL_COSINE)


@dataclass(frozen=True)
class _End:
    """An end of a prism: upward for side 1, downward for -1.

    The end of the field is searched only on demand, because most prisms are made only for their evidence.

    Attributes:
        gpis: the field.
        side: 1 for the top, -1 for the bottom.
        members: indices of the contacts on it.
    """

    gpis: Gpis
    side: float
    members: Indices

    @property
    def log_likelihood(self) -> float:
        """Log likelihood of the contacts on it, zero if there are none."""
        return self.level.log_likelihood if len(self.members) else 0.0

    @cached_property
    def level(self) -> Level:
        """The level of its contacts, or the end of the field if there are none."""
        if len(self.members) == 0:
            end = field_end(self.gpis, np.array([0.0, 0.0, self.side]))
            return Level(self.side * end.offset_m, end.sigma_m, 0.0)
        contacts, members = contacts_of(self.gpis), self.members
        weights, turns = contacts.point_weights[members], contacts.normal_weights[members]
        heights = contacts.points_m[members, 2]
        height_m = float(np.average(heights, weights=weights))
        away = contacts.normals[members] - [0.0, 0.0, self.side]
        misfit = np.sum(weights * (heights - height_m) ** 2) + np.sum(turns[:, None] * away**2)
        scale = _scale(weights) + 3 * _scale(turns) - 0.5 * np.log(len(contacts))
        return Level(height_m, float(weights.sum() ** -0.5), float(scale - 0.5 * misfit))


def _scale(weights: Array) -> float:
    """Logarithm of the factors before Gaussians of these inverse variances."""
    return float(0.5 * np.sum(np.log(weights) - np.log(2 * np.pi)))


def _planar_field(gpis: Gpis, contacts: WeightedContacts, walls: Indices) -> Gpis:
    """The field of the walls' contacts seen from above."""
    level = contacts.normals[walls, :2]
    return Gpis.fit(
        contacts.points_m[walls, :2],
        level / np.linalg.norm(level, axis=1, keepdims=True),
        contacts.point_weights[walls] ** -0.5,
        contacts.normal_weights[walls] ** -0.5,
        gpis.settings,
    ).optimise(max_iterations=15)


def _beside(free_points_m: Array | None, top: _End, bottom: _End) -> Array | None:
    """Free places at the heights of the prism, seen from above."""
    if free_points_m is None or len(free_points_m) == 0:
        return None
    heights = free_points_m[:, 2]
    return free_points_m[(heights > bottom.level.height_m) & (heights < top.level.height_m), :2]


def _thin(contour: Contour, step_m: float) -> tuple[Array, Array]:
    """Points of a contour about ``step_m`` apart, including its corners, and their sigmas."""
    points = contour.points_m
    before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
    lengths = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    turns = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]) / np.maximum(lengths, 1e-15)
    keep = turns > _CORNER_TURN
    along = 0.0
    for index, length in enumerate(np.linalg.norm(before, axis=1)):
        along += float(length)
        if keep[index] or along >= step_m:
            keep[index], along = True, 0.0
    return points[keep], contour.sigma_m[keep]


def _extrude(ring_m: Array, bottom_m: float, top_m: float) -> FacetMesh:
    """Walls (part 0), top (1) and bottom (2) over a counter-clockwise ring of shape (n, 2)."""
    count = len(ring_m)
    vertices = np.vstack([np.column_stack([ring_m, np.full(count, height)]) for height in (bottom_m, top_m)])
    here, following = np.arange(count), np.roll(np.arange(count), -1)
    walls = np.vstack(
        [
            np.column_stack([here, following, following + count]),
            np.column_stack([here, following + count, here + count]),
        ]
    )
    lid = ear_triangles(ring_m)
    parts = np.repeat([0, 1, 2], [len(walls), len(lid), len(lid)])
    return FacetMesh(vertices, np.vstack([walls, lid + count, lid[:, ::-1]]), parts)


def ear_triangles(ring_m: Array) -> Indices:
    """Triangulate a simple counter-clockwise polygon of shape (n, 2) by cutting off ears, the roundest first.

    Flat ears, which occur on straight sides with intermediate points, are cut last, because they would be degenerate.

    Raises:
        ShapeError: the polygon crosses itself.
    """
    left = list(range(len(ring_m)))
    flat_m2 = _FLAT_EAR * float(np.ptp(ring_m, axis=0).max()) ** 2
    triangles = []
    while len(left) > 3:
        corners = np.array(left)
        before, after = np.roll(corners, 1), np.roll(corners, -1)
        ears = _ears(ring_m, before, corners, after, flat_m2)
        if not ears.any():
            ears = _ears(ring_m, before, corners, after, 0.0)
        if not ears.any():
            raise ShapeError("the outline crosses itself", hint="More contacts would help")
        spans = np.where(ears, np.linalg.norm(ring_m[after] - ring_m[before], axis=1), np.inf)
        cut = int(spans.argmin())
        triangles.append((before[cut], corners[cut], after[cut]))
        del left[cut]
    return np.array([*triangles, tuple(left)], dtype=np.int64)


def _ears(ring_m: Array, before: Indices, corners: Indices, after: Indices, least_m2: float) -> Array:
    """Whether each corner can be cut off: it turns left, and no other corner lies in its triangle or on its sides.

    Three points count as collinear if twice the area of their triangle is below ``least_m2``.
    """
    a, b, c = ring_m[before], ring_m[corners], ring_m[after]
    ears = _turn(a, b, c) > least_m2
    for ear in np.flatnonzero(ears):
        points = ring_m[corners]
        sides = [_turn(p[ear], q[ear], points) for p, q in ((a, b), (b, c), (c, a))]
        within = np.minimum.reduce(sides) >= -least_m2
        within[[ear, ear - 1, (ear + 1) % len(corners)]] = False
        ears[ear] = not within.any()
    return np.asarray(ears)


def _turn(a: Array, b: Array, c: Array) -> Array:
    """Twice the signed area of triangles a b c."""
    first, second = b - a, c - a
    return np.asarray(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])


def _nearest(points_m: Array, ring_m: Array, values: Array) -> Array:
    """The value at the ring's vertex nearest to each point (q, 2)."""
    return np.asarray(values[cKDTree(ring_m).query(points_m)[1]])
