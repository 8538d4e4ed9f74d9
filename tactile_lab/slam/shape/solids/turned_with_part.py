"""A solid of revolution with a part beside it: a cup with its handle, a can with its spout, a teapot with both.

Contacts are divided into those of the body, which turns about an axis, and those beside it. Of the latter those near
one another make up a part: a smooth field, told where fingers went through, and joined to the body where it is nearest,
since an object is one piece.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.known_places import in_one_piece, outside_at
from tactile_lab.slam.shape.fields.posterior import Prediction
from tactile_lab.slam.shape.solids.axis import SIDEWAYS, find_axis, split, squares_around, to_profile
from tactile_lab.slam.shape.solids.planes import WeightedContacts
from tactile_lab.slam.shape.solids.polyhedron import contacts_of
from tactile_lab.slam.shape.solids.turned import Turned
from tactile_lab.slam.shape.surfaces.surface import Contour, Indices, Mask, SurfaceMesh, extract_mesh

_BESIDE_m, _OTHER_SIDE_rad = 0.008, np.deg2rad(45.0)
"""How much farther from the axis than contacts in other directions one is that speaks against a body."""
_NEAR_HEIGHT_m, _PASSES_BY = 0.015, 5.0**2
"""Heights that are compared, and what a normal has at most across the plane through the axis, in variances."""
_STEEPEST = 1.0
"""Largest slope of a body's outer wall, in radius per height."""
_ON_BODY_m, _OFF_BODY_m = 0.003, 0.005
_LEFT_OUT_nats = 12.0
"""A contact of the body that costs more than one outlier among twenty good contacts is one of the part."""
_LARGEST_SHARE, _LEAST_CONTACTS = 0.35, 2
_PRICE_nats, _CONTACT_PRICE_nats = 5.0, 1.0
"""Of the part's field with its kernel, and of saying that a contact is one of the part."""
_APART_m = 0.060
"""Between contacts of different parts."""
_KERNEL_STEPS = 20
_GRID_m = 0.003
"""Walls of cups are hardly thicker."""
_LARGEST_LENGTH_m = 0.080
"""Of the part's kernel: a part is no larger."""


@dataclass(frozen=True)
class TurnedWithPart:
    """A solid of revolution and a field beside it; implements FittedShape. Made by :meth:`fit`.

    Attributes:
        body: the solid of revolution, fitted to its own contacts.
        parts: fields of the other contacts, one for each part.
        log_evidence: the sum of both, minus the price of the division.
        name: "turned with a part".
    """

    body: Turned
    parts: tuple[Gpis, ...]
    log_evidence: float
    name: str = "turned with a part"

    @classmethod
    def fit(cls, gpis: Gpis, floor_m: float, free_points_m: Array | None = None) -> Self:
        """Divide the contacts of a field, and fit both.

        Args:
            gpis: a field fitted in space.
            floor_m: height of the table that the object stands on.
            free_points_m: places that a finger went through, shape (k, 3), or None.

        Raises:
            ShapeError: there is no axis, nothing lies beside a body, or so much that it is no body.
        """
        contacts = contacts_of(gpis)
        beside = _check(_beside(contacts))
        body = Turned.fit(gpis.of_some(np.flatnonzero(~beside)), floor_m, free_points_m)
        divided = _check(_divide(contacts, beside, body))
        if (divided != beside).any():
            body = Turned.fit(gpis.of_some(np.flatnonzero(~divided)), floor_m, free_points_m)
        parts = [_part(gpis, members) for members in _groups(contacts, divided)]
        price = _PRICE_nats * len(parts) + _CONTACT_PRICE_nats * np.count_nonzero(divided)
        evidence = body.log_evidence + sum(part.log_marginal_likelihood() for part in parts) - price
        free_m = np.empty((0, 3)) if free_points_m is None else np.reshape(free_points_m, (-1, 3))
        free_m = np.vstack([free_m, _before(contacts)])
        return cls(body, tuple(outside_at(part, free_m) for part in parts), float(evidence))

    def contour(self, resolution_m: float = 0.001) -> Contour:
        """Raises ShapeError: a solid has no outline."""
        raise ShapeError("contacts in space have a surface, not an outline", hint="Ask for the mesh")

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        """The surface; it always ends at the table, and is no coarser than thin walls allow.

        Raises:
            ShapeError: nothing is inside.
        """
        floor_m = self.body.floor_m if floor_m is None else floor_m
        return extract_mesh(self.union, resolution_m=min(resolution_m, _GRID_m), floor_m=floor_m)

    @cached_property
    def union(self) -> Union:
        """Body and parts, each joined to the body."""
        joined = [in_one_piece(each, _GRID_m, lambda part: Union(self.body, (part,))) for each in self.parts]
        return Union(self.body, tuple(joined))


@dataclass(frozen=True)
class Union:
    """The union of a body and parts, as a field."""

    body: Turned
    parts: tuple[Gpis, ...]
    sigma_inflation: float = 1.0
    """Predicted variances are those of surfaces already."""

    @cached_property
    def contacts_m(self) -> Array:
        """Of all, shape (n, 3), those of the body turned about the axis."""
        return np.vstack([self.body.contacts_m, *(part.contacts_m for part in self.parts)])

    def predict(self, points_m: Array, *, gradient: bool = False, variance: bool = False) -> Prediction:
        """The field at points of shape (q, 3): that of whichever is nearest, or deepest inside."""
        nearest = self.body.predict(points_m, gradient=gradient, variance=variance)
        for part in self.parts:
            found = part.predict(points_m, gradient=gradient, variance=variance)
            spread = part.sigma_inflation**2 * found.variance_m2
            nearest = _nearer(nearest, Prediction(found.mean_m, found.gradient, spread))
        return nearest


def _nearer(one: Prediction, other: Prediction) -> Prediction:
    closer = other.mean_m < one.mean_m
    gradient, variance_m2 = one.gradient, one.variance_m2
    if len(gradient):
        gradient = np.where(closer[:, None], other.gradient, gradient)
    if len(variance_m2):
        variance_m2 = np.where(closer, other.variance_m2, variance_m2)
    return Prediction(np.minimum(one.mean_m, other.mean_m), gradient, variance_m2)


def _check(beside: Mask) -> Mask:
    count = np.count_nonzero(beside)
    if not _LEAST_CONTACTS <= count <= _LARGEST_SHARE * len(beside):
        raise ShapeError(f"{count} of {len(beside)} contacts lie beside a solid of revolution")
    return beside


def _beside(contacts: WeightedContacts) -> Mask:
    """Contacts that a body that turns about the axis cannot have: their normals pass it by, or at their height walls in
    other directions are nearer to the axis, more of them than there are as far out.
    """
    axis_m, _ = find_axis(contacts)
    arms_m = contacts.points_m[:, :2] - axis_m
    angles, (reach_m, heights_m) = np.arctan2(arms_m[:, 1], arms_m[:, 0]), to_profile(contacts.points_m, axis_m).T
    elsewhere = np.abs((angles[:, None] - angles + np.pi) % (2 * np.pi) - np.pi) > _OTHER_SIDE_rad
    apart_m, farther_m = np.abs(heights_m[:, None] - heights_m), reach_m[:, None] - reach_m
    near = elsewhere & (apart_m < _NEAR_HEIGHT_m)
    is_wall = split(contacts, axis_m)[0][:, 0] > SIDEWAYS
    against = near & is_wall & (farther_m > _BESIDE_m + _STEEPEST * apart_m)
    in_favour = near & (np.abs(farther_m) < _BESIDE_m)
    passes_by = squares_around(contacts, axis_m)[0] > _PASSES_BY
    return np.asarray(passes_by | (against.sum(axis=1) > in_favour.sum(axis=1)))


def _divide(contacts: WeightedContacts, beside: Mask, body: Turned) -> Mask:
    """The division after a look at the body: contacts beside it that lie on its surface belong to it, and those of the
    body that its other contacts make improbable do not.
    """
    beside = beside & ~_is_on(contacts, body)
    members, half = np.flatnonzero(~beside).astype(np.int64), body.half_of(contacts, ~beside)
    for _ in range(int(_LARGEST_SHARE * len(contacts))):
        excess = half.leave_one_out_costs(np.arange(len(members))) - _least_costs(contacts, members)
        excess += 0.5 * squares_around(contacts, body.axis_m)[0][members]
        worst = int(np.argmax(excess))
        rest = np.delete(np.arange(len(members)), worst)
        others = half.of_some(rest)
        is_off = abs(float(others.mean(half.contacts_m[worst : worst + 1])[0])) > _OFF_BODY_m
        if excess[worst] < _LEFT_OUT_nats or not is_off:
            break
        members, half = members[rest], others
    divided = np.ones(len(contacts), dtype=bool)
    divided[members] = False
    return divided


def _is_on(contacts: WeightedContacts, body: Turned) -> Mask:
    found = body.predict(contacts.points_m, gradient=True)
    slope = found.gradient / np.maximum(np.linalg.norm(found.gradient, axis=1, keepdims=True), 1e-9)
    return np.asarray((np.abs(found.mean_m) < _ON_BODY_m) & (np.sum(slope * contacts.normals, axis=1) > 0.5))


def _least_costs(contacts: WeightedContacts, members: Indices) -> Array:
    """Costs of contacts of the profile that fit exactly."""
    points, normals = contacts.point_weights[members], contacts.normal_weights[members]
    return np.asarray(-0.5 * np.log(points) - np.log(normals))


def _groups(contacts: WeightedContacts, beside: Mask) -> list[Mask]:
    """Contacts of each part: those near one another."""
    chosen = np.flatnonzero(beside)
    labels = fcluster(linkage(contacts.points_m[chosen], "single"), _APART_m, "distance")
    return [np.isin(np.arange(len(contacts)), chosen[labels == label]) for label in np.unique(labels)]


def _part(gpis: Gpis, beside: Mask) -> Gpis:
    """The field of some contacts, its kernel at a maximum of their marginal likelihood."""
    seen = gpis.observations
    sigmas = seen.value_sigma_m[beside], seen.gradient_sigma[beside]
    part = Gpis.fit(gpis.contacts_m[beside], gpis.normals[beside], *sigmas, gpis.settings)
    return part.optimise(max_iterations=_KERNEL_STEPS, longest_m=_LARGEST_LENGTH_m)


def _before(contacts: WeightedContacts) -> Array:
    """Places before all contacts, where their fingertips were."""
    return np.asarray(contacts.points_m + 0.006 * contacts.normals)
