"""A solid of revolution with a part beside it: a cup with its handle, a can with its spout, a teapot with both.

Contacts are divided into those of the body, which turns about an axis, and those beside it, which make up parts
(:mod:`tactile_lab.slam.shape.solids.with_parts`), or are wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.solids.axis import SIDEWAYS, find_axis, split, squares_around, to_profile
from tactile_lab.slam.shape.solids.planes import WeightedContacts
from tactile_lab.slam.shape.solids.polyhedron import contacts_of
from tactile_lab.slam.shape.solids.turned import Turned
from tactile_lab.slam.shape.solids.with_parts import WithParts
from tactile_lab.slam.shape.surfaces.surface import Indices, Mask

_BESIDE_m, _OTHER_SIDE_rad = 0.008, np.deg2rad(45.0)
"""How much farther from the axis than contacts in other directions one is that speaks against a body."""
_NEAR_HEIGHT_m, _PASSES_BY = 0.015, 5.0**2
"""Heights that are compared, and what a normal has at most across the plane through the axis, in variances."""
_STEEPEST = 1.0
"""Largest slope of a body's outer wall, in radius per height."""
_ON_BODY_m, _OFF_BODY_m = 0.003, 0.005
_LEFT_OUT_nats = 12.0
"""A contact of the body that costs more than one outlier among twenty good contacts is one of the part."""
_LARGEST_SHARE, LEAST_OF_PARTS, _LARGEST_SHARE_OF_STRAYS = 0.35, 2, 0.1
"""Share of contacts that lie beside a body at most, number of them that makes up parts, and share that may be wrong."""


@dataclass(frozen=True)
class Division:
    """Contacts divided into those of a solid of revolution and those beside it. Made by :meth:`of`.

    Attributes:
        gpis: the field of all contacts.
        body: fitted to its own.
        beside: which are not its own, shape (n,).
        impossible: how many no body can have; others beside this one are only improbable.
    """

    gpis: Gpis
    body: Turned
    beside: Mask
    impossible: int

    @classmethod
    def of(cls, gpis: Gpis, floor_m: float, free_points_m: Array | None = None, *, least: int = 0) -> Self:
        """Divide the contacts of a field.

        Args:
            gpis: a field fitted in space.
            floor_m: height of the table that the object stands on.
            free_points_m: places that a finger went through, shape (k, 3), or None.
            least: contacts that no body can have; fewer are no reason to look closer.

        Raises:
            ShapeError: there is no axis, or so much lies beside a body that it is none, or less than asked for.
        """
        contacts = contacts_of(gpis)
        beside = _check(_beside(contacts), least)
        body = Turned.fit(gpis.of_some(np.flatnonzero(~beside)), floor_m, free_points_m)
        divided = _check(_divide(contacts, beside, body))
        if (divided != beside).any():
            body = Turned.fit(gpis.of_some(np.flatnonzero(~divided)), floor_m, free_points_m)
        return cls(gpis, body, divided, int(beside.sum()))

    def with_parts(self, floor_m: float, free_points_m: Array | None = None) -> WithParts:
        """The body, and parts of what lies beside it.

        Raises:
            ShapeError: hardly any contact has to.
        """
        if self.impossible < LEAST_OF_PARTS:
            raise ShapeError(f"{self.impossible} contacts that cannot lie on a body make up no part")
        _check(self.beside, LEAST_OF_PARTS)
        return WithParts.of(self.body, self.gpis, self.beside, floor_m, free_points_m)

    def without_strays(self) -> Turned:
        """The body alone, what lies beside it wrong, each contact at the price of an outlier.

        Raises:
            ShapeError: more lies beside it than sensors get wrong.
        """
        strays = np.flatnonzero(self.beside)
        if len(strays) > _LARGEST_SHARE_OF_STRAYS * len(self.beside):
            raise ShapeError(f"{len(strays)} of {len(self.beside)} contacts are no strays")
        costs = _least_costs(contacts_of(self.gpis), strays) + 2 * np.log(2 * np.pi) + _LEFT_OUT_nats
        return replace(self.body, log_evidence=self.body.log_evidence - float(costs.sum()))


def _check(beside: Mask, least: int = 0) -> Mask:
    count = np.count_nonzero(beside)
    if not least <= count <= _LARGEST_SHARE * len(beside):
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
    found = body.predict(contacts.points_m)
    slope = found.gradient / np.maximum(np.linalg.norm(found.gradient, axis=1, keepdims=True), 1e-9)
    meets = squares_around(contacts, body.axis_m)[0] <= _PASSES_BY
    faces_out = np.sum(slope * contacts.normals, axis=1) > 0.5
    return np.asarray(meets & faces_out & (np.abs(found.mean_m) < _ON_BODY_m))


def _least_costs(contacts: WeightedContacts, members: Indices) -> Array:
    """Costs of contacts of the profile that fit exactly."""
    points, normals = contacts.point_weights[members], contacts.normal_weights[members]
    return np.asarray(-0.5 * np.log(points) - np.log(normals))
