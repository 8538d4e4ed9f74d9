"""A solid of revolution with a part beside it: a cup with its handle, a can with its spout, a teapot with both.

Contacts are divided into those of the body, which turns about an axis, and those beside it, which make up parts
(:mod:`tactile_lab.slam.shape.solids.with_parts`).
"""

from __future__ import annotations

from dataclasses import replace

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
_LARGEST_SHARE, _LEAST_CONTACTS, _LARGEST_SHARE_OF_STRAYS = 0.35, 2, 0.1


def turned_with_parts(gpis: Gpis, floor_m: float, free_points_m: Array | None = None) -> WithParts:
    """Divide the contacts of a field, and fit body and parts.

    Args:
        gpis: a field fitted in space.
        floor_m: height of the table that the object stands on.
        free_points_m: places that a finger went through, shape (k, 3), or None.

    Raises:
        ShapeError: there is no axis, nothing lies beside a body, or so much that it is no body.
    """
    body, beside = _body(gpis, floor_m, free_points_m, (_LEAST_CONTACTS, _LARGEST_SHARE))
    return WithParts.of(body, gpis, beside, floor_m, free_points_m)


def turned_without_strays(gpis: Gpis, floor_m: float, free_points_m: Array | None = None) -> tuple[Turned, Indices]:
    """Fit a body to all contacts but a few that lie beside it, each at the price of an outlier; and which are left.

    Arguments and errors as of :func:`turned_with_parts`.
    """
    body, strays = _body(gpis, floor_m, free_points_m, (0, _LARGEST_SHARE_OF_STRAYS))
    left_out = _least_costs(contacts_of(gpis), np.flatnonzero(strays)) + 2 * np.log(2 * np.pi) + _LEFT_OUT_nats
    return replace(body, log_evidence=body.log_evidence - float(left_out.sum())), np.flatnonzero(~strays)


def _body(gpis: Gpis, floor_m: float, free_points_m: Array | None, limits: tuple[int, float]) -> tuple[Turned, Mask]:
    """A body, and the contacts beside it, at least so many and at most such a share.

    Raises:
        ShapeError: there is no axis, or fewer contacts or more lie beside it.
    """
    contacts = contacts_of(gpis)
    beside = _check(_beside(contacts), *limits)
    body = Turned.fit(gpis.of_some(np.flatnonzero(~beside)), floor_m, free_points_m)
    divided = _check(_divide(contacts, beside, body), *limits)
    if (divided != beside).any():
        body = Turned.fit(gpis.of_some(np.flatnonzero(~divided)), floor_m, free_points_m)
    return body, divided


def _check(beside: Mask, least: int, largest_share: float) -> Mask:
    count = np.count_nonzero(beside)
    if not least <= count <= largest_share * len(beside):
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
