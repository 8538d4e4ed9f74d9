"""A solid and parts beside it, such as a handle or a spout, which its model cannot have.

Contacts near one another make up a part: a smooth field of their own, told where fingers went through, and joined to
the solid where it is nearest, since an object is one piece. A part whose sides show how wide it is is taken for a bar,
no thicker than wide, with an opening behind it, until it was felt there: handles are more common than fins.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial import cKDTree

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.known_places import DEPTH_m, inside_at, outside_at
from tactile_lab.slam.shape.fields.posterior import Prediction
from tactile_lab.slam.shape.model import FittedShape
from tactile_lab.slam.shape.solids.solid_field import SolidField
from tactile_lab.slam.shape.surfaces.surface import Contour, Mask, SurfaceMesh, extract_mesh

ONE_PART_m = 0.060
"""Contacts no farther than this from the next are of one part."""
PRICE_nats, CONTACT_PRICE_nats = 5.0, 1.0
"""Of a part's field with its kernel, and of saying that a contact belongs to it."""
_KERNEL_STEPS, _LARGEST_LENGTH_m = 20, 0.080
_FINGERTIP_m = 0.006
"""Smallest thickness of a fingertip: what is this far outside of a contact is free."""
_PLACES, _STEP_m, _DEPTH_m = 40, 0.006, 0.003
_TO_A_SIDE, _AWAY = 0.35, 0.5
"""Cosines from which on a contact of a bar tells how wide it is, and lies on the side away from the body."""
_BAR_m, _BAR_SIGMA_m, _ROUND_SIGMA_m, _RADII_m = 0.006, 0.004, 0.0015, (0.003, 0.040)
"""Radius of a bar before contacts tell it, its standard deviation, how far bars are from round, and all radii."""
_GRID_m = 0.003
"""Walls of cups are hardly thicker."""


@dataclass(frozen=True)
class WithParts:
    """A solid with parts; implements FittedShape. Made by :meth:`of`.

    Attributes:
        body: the solid, fitted to its own contacts.
        parts: fields of the other contacts, one for each part.
        floor_m: height of the table that it stands on; None without one.
        log_evidence: of all contacts, reduced by the price of the parts.
    """

    body: FittedShape
    parts: tuple[Gpis, ...]
    floor_m: float | None
    log_evidence: float

    @classmethod
    def of(
        cls, body: FittedShape, gpis: Gpis, beside: Mask, floor_m: float | None, free_points_m: Array | None = None
    ) -> Self:
        """Add parts to a solid.

        Args:
            body: fitted to the contacts that are not ``beside``.
            gpis: a field of all contacts, normals observed.
            beside: which of them make up parts, shape (n,).
            floor_m: height of the table, None without one.
            free_points_m: places that a finger went through, shape (k, 3), or None.

        Raises:
            ShapeError: the contacts cannot be used.
        """
        parts = [_part(gpis, members) for members in _groups(gpis.contacts_m, beside)]
        price = PRICE_nats * len(parts) + CONTACT_PRICE_nats * np.count_nonzero(beside)
        evidence = (body.log_evidence or 0.0) + sum(part.log_marginal_likelihood() for part in parts) - price
        free_m = gpis.contacts_m + _FINGERTIP_m * gpis.normals
        free_m = free_m if free_points_m is None else np.vstack([free_m, free_points_m])
        return cls(body, tuple(outside_at(part, free_m) for part in parts), floor_m, float(evidence))

    @property
    def name(self) -> str:
        """Of the body, "with a part"."""
        return f"{self.body.name} with a part"

    def contour(self, resolution_m: float = 0.001) -> Contour:
        """Raises ShapeError: a solid has no outline."""
        raise ShapeError("contacts in space have a surface, not an outline", hint="Ask for the mesh")

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        """The surface of all, no coarser than thin walls allow; it ends at the table for which it was made.

        Raises:
            ShapeError: nothing is inside.
        """
        floor_m = self.floor_m if floor_m is None else floor_m
        return extract_mesh(self.union, resolution_m=min(resolution_m, _GRID_m), floor_m=floor_m)

    @cached_property
    def union(self) -> Union:
        """Body and parts, each joined to the body."""
        mesh = self.body.mesh(_GRID_m, self.floor_m)
        body = SolidField(mesh, mesh.sigma_m)
        return Union(body, _places(mesh), tuple(_joined(_opened(part, body), body) for part in self.parts))


@dataclass(frozen=True)
class Union:
    """The union of a body and parts, as a field."""

    body: SolidField
    places_m: Array
    """Some on the body, from end to end, shape (n, 3)."""

    parts: tuple[Gpis, ...]
    sigma_inflation: float = 1.0
    """Predicted variances are those of surfaces already."""

    @cached_property
    def contacts_m(self) -> Array:
        """Of the parts, and places on the body, shape (n, 3)."""
        return np.vstack([self.places_m, *(part.contacts_m for part in self.parts)])

    def predict(self, points_m: Array, *, gradient: bool = False, variance: bool = False) -> Prediction:
        """The field at points of shape (q, 3): that of whichever is nearest, or deepest inside."""
        nearest = self.body.predict(points_m, gradient=gradient, variance=variance)
        for part in self.parts:
            found = part.predict(points_m, gradient=gradient, variance=variance)
            spread = part.sigma_inflation**2 * found.variance_m2
            nearest = _nearer(nearest, Prediction(found.mean_m, found.gradient, spread))
        return nearest


def _places(mesh: SurfaceMesh) -> Array:
    """Some vertices, the outermost along each axis among them."""
    vertices = mesh.vertices
    spread = np.linspace(0, len(vertices) - 1, _PLACES).astype(np.intp)
    return np.asarray(vertices[np.concatenate([spread, vertices.argmin(axis=0), vertices.argmax(axis=0)])])


def _nearer(one: Prediction, other: Prediction) -> Prediction:
    closer = other.mean_m < one.mean_m
    gradient, variance_m2 = one.gradient, one.variance_m2
    if len(gradient):
        gradient = np.where(closer[:, None], other.gradient, gradient)
    if len(variance_m2):
        variance_m2 = np.where(closer, other.variance_m2, variance_m2)
    return Prediction(np.minimum(one.mean_m, other.mean_m), gradient, variance_m2)


def _opened(part: Gpis, body: SolidField) -> Gpis:
    """The part, if it is a bar of known width, with what is beside it outside, and what is behind it as far as the body
    where no contact says otherwise.
    """
    around = body.predict(part.contacts_m, gradient=True)
    away = around.gradient.mean(axis=0) / max(float(np.linalg.norm(around.gradient.mean(axis=0))), 1e-9)
    across = _across(part.contacts_m, away)
    radius_m = _radius_m(part, across)
    if radius_m is None:
        return part
    facing = np.flatnonzero(part.normals @ away > _AWAY)
    middles_m = part.contacts_m[facing] - radius_m * part.normals[facing]
    beside_m = (radius_m + DEPTH_m) * across
    behind_m = [
        middle_m - np.arange(radius_m + DEPTH_m, gap_m - radius_m - _FINGERTIP_m, _STEP_m)[:, None] * away
        for middle_m, gap_m in zip(middles_m, around.mean_m[facing], strict=True)
    ]
    open_m = np.vstack([np.empty((0, 3)), *behind_m])
    open_m = open_m[cKDTree(part.contacts_m).query(open_m)[0] > radius_m + _FINGERTIP_m / 2]
    return outside_at(part, np.vstack([middles_m + beside_m, middles_m - beside_m, open_m]))


def _across(points_m: Array, away: Array) -> Array:
    """Unit vector across a bar through points, and across the way to the body, shape (3,)."""
    aside = points_m - points_m.mean(axis=0)
    along = np.linalg.svd(aside - np.outer(aside @ away, away))[2][0]
    return np.cross(away, along)


def _radius_m(part: Gpis, across: Array) -> float | None:
    """Of a round bar through the part's contacts; None unless both its sides were felt."""
    facing = part.normals @ across
    if facing.max() < _TO_A_SIDE or facing.min() > -_TO_A_SIDE:
        return None
    rows = np.vstack([np.column_stack([facing, np.ones(len(facing))]) / _ROUND_SIGMA_m, [1 / _BAR_SIGMA_m, 0.0]])
    places = np.append(part.contacts_m @ across / _ROUND_SIGMA_m, _BAR_m / _BAR_SIGMA_m)
    return float(np.clip(np.linalg.lstsq(rows, places, rcond=None)[0][0], *_RADII_m))


def _joined(part: Gpis, body: SolidField) -> Gpis:
    """The part with the shortest way between it and the body inside, if they do not meet."""
    near_m = part.contacts_m - _DEPTH_m * part.normals
    grid_m = _around(part.contacts_m)
    inside_m = np.vstack([near_m, grid_m[part.mean(grid_m) < 0]])
    found = body.predict(inside_m, gradient=True)
    nearest = int(found.mean_m.argmin())
    gap_m = float(found.mean_m[nearest])
    if gap_m < 0:
        return part
    steps_m = np.linspace(0.0, gap_m + _DEPTH_m, int(np.ceil(gap_m / _STEP_m)) + 2)
    return inside_at(part, inside_m[nearest] - steps_m[:, None] * found.gradient[nearest])


def _around(points_m: Array) -> Array:
    """A grid around points of shape (n, 3)."""
    low_m, high_m = points_m.min(axis=0) - _STEP_m, points_m.max(axis=0) + _STEP_m
    axes = [np.arange(low, high + _GRID_m, _GRID_m) for low, high in zip(low_m, high_m, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def _groups(points_m: Array, beside: Mask) -> list[Mask]:
    """Contacts of each part: those near one another."""
    chosen = np.flatnonzero(beside)
    if len(chosen) == 1:
        return [beside]
    labels = fcluster(linkage(points_m[chosen], "single"), ONE_PART_m, "distance")
    return [np.isin(np.arange(len(points_m)), chosen[labels == label]) for label in np.unique(labels)]


def _part(gpis: Gpis, beside: Mask) -> Gpis:
    """The field of some contacts, its kernel at a maximum of their marginal likelihood."""
    seen = gpis.observations
    sigmas = seen.value_sigma_m[: len(beside)][beside], seen.gradient_sigma[beside]
    part = Gpis.fit(gpis.contacts_m[beside], gpis.normals[beside], *sigmas, gpis.settings)
    return part.optimise(max_iterations=_KERNEL_STEPS, longest_m=_LARGEST_LENGTH_m)
