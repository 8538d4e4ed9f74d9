"""Observations of the surface field by contacts: rows of values and gradients, with their noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError

LARGEST_SPREAD_m = 2.0
"""Contacts of a graspable object lie closer together than this; larger distances mean wrong units."""

POINTS_A_CONTACT = 3
"""On it, outside and inside, where normals are not observed."""

_OUTER_SPHERE_POINTS, _INNER_SPHERE_POINTS = 60, 12
_OUTER_SPHERE_RATIO, _INNER_SPHERE_RATIO = 1.3, 0.4


@dataclass(frozen=True)
class Observations:
    """Observed values of the field at n points, and its gradients at the first m of them.

    Attributes:
        points_m: shape (n, d), d = 2 or 3.
        values_m: shape (n,), field values.
        value_sigma_m: shape (n,), their standard deviations.
        gradients: shape (m, d), gradients at ``points_m[:m]``; m may be 0.
        gradient_sigma: shape (m,), standard deviation of each gradient component.
    """

    points_m: Array
    values_m: Array
    value_sigma_m: Array
    gradients: Array
    gradient_sigma: Array

    @property
    def noise_variance(self) -> Array:
        """Variances in the order of the rows: values, then the gradients component by component."""
        dimension = self.points_m.shape[1]
        return np.concatenate([self.value_sigma_m**2, np.tile(self.gradient_sigma**2, dimension)])


def derivative_observations(points_m: Array, normals: Array, point_sigma_m: Array, normal_sigma: Array) -> Observations:
    """At each contact the field is zero and its gradient is the normal, so that the field is nearly a signed distance.

    Args:
        points_m: contact points, shape (n, d).
        normals: outward unit normals, shape (n, d).
        point_sigma_m: shape (n,).
        normal_sigma: shape (n,), radians.
    """
    return Observations(points_m, np.zeros(len(points_m)), point_sigma_m, normals, normal_sigma)


def offsurface_observations(points_m: Array, normals: Array, point_sigma_m: Array, distance_m: float) -> Observations:
    """The thesis's rows (section 2.2.2): zero on each contact, outside and inside points along its normal.

    The thesis labels outside and inside +1 and -1. Here the labels are ``+-distance_m``, the same field
    times a constant, so that values stay metres. In space the points of section 2.2.4 are added: on a sphere
    that encloses the contacts (outside) and on a small one amid them (inside, where the nearest contact agrees).
    """
    groups = [
        (points_m, 0.0, point_sigma_m),
        (points_m + distance_m * normals, distance_m, point_sigma_m),
        (points_m - distance_m * normals, -distance_m, point_sigma_m),
    ]
    if points_m.shape[1] == 3:
        outer, inner = _sphere_points(points_m, normals)
        sigma_m = float(point_sigma_m.mean())
        groups.append((outer, distance_m, np.full(len(outer), sigma_m)))
        groups.append((inner, -distance_m, np.full(len(inner), sigma_m)))
    return Observations(
        points_m=np.vstack([points for points, _, _ in groups]),
        values_m=np.concatenate([np.full(len(points), label) for points, label, _ in groups]),
        value_sigma_m=np.concatenate([sigma for _, _, sigma in groups]),
        gradients=np.empty((0, points_m.shape[1])),
        gradient_sigma=np.empty(0),
    )


def _sphere_points(points_m: Array, normals: Array) -> tuple[Array, Array]:
    """Points on the sphere around all contacts, and those on the inner sphere that are inside by the nearest normal."""
    centre = (points_m.min(axis=0) + points_m.max(axis=0)) / 2
    distances = np.linalg.norm(points_m - centre, axis=1)
    outer = centre + _OUTER_SPHERE_RATIO * distances.max() * fibonacci_sphere(_OUTER_SPHERE_POINTS)
    inner = centre + _INNER_SPHERE_RATIO * distances.min() * fibonacci_sphere(_INNER_SPHERE_POINTS)
    nearest = np.linalg.norm(inner[:, None] - points_m[None], axis=2).argmin(axis=1)
    is_inside = np.sum((inner - points_m[nearest]) * normals[nearest], axis=1) < 0
    return outer, inner[is_inside]


def fibonacci_sphere(count: int) -> Array:
    """Nearly even directions, unit vectors of shape (count, 3)."""
    index = np.arange(count) + 0.5
    height = 1 - 2 * index / count
    longitude = np.pi * (1 + np.sqrt(5)) * index
    radius = np.sqrt(1 - height**2)
    return np.column_stack([radius * np.cos(longitude), radius * np.sin(longitude), height])


def check_contacts(points_m: Array, normals: Array, point_sigma_m: Array, normal_sigma: Array) -> None:
    """Refuse contacts to which no surface can be fitted.

    Raises:
        ShapeError: there are no contacts, array shapes do not match, entries are NaN, infinite or negative, normals are
            not of unit length, or contacts are metres apart.
    """
    count = len(points_m)
    if count < 1:
        raise ShapeError("no contacts to fit a surface to", hint="At least one contact with its normal is needed")
    if points_m.ndim != 2 or points_m.shape[1] not in (2, 3) or normals.shape != points_m.shape:
        raise ShapeError(
            f"points of shape {points_m.shape} and normals of shape {normals.shape} do not match (n, 2 or 3)"
        )
    if point_sigma_m.shape != (count,) or normal_sigma.shape != (count,):
        raise ShapeError(f"{count} contacts need as many standard deviations of points and of normals")
    columns = (points_m, normals, point_sigma_m, normal_sigma)
    if not all(np.isfinite(column).all() for column in columns):
        bad = np.flatnonzero(~np.isfinite(np.column_stack(columns)).all(axis=1))
        raise ShapeError(
            f"contact {bad[0]} has a coordinate that is not a number", hint="Check the sensor it came from"
        )
    if min(point_sigma_m.min(), normal_sigma.min()) < 0:
        raise ShapeError("standard deviations of contacts cannot be negative")
    lengths = np.linalg.norm(normals, axis=1)
    if np.abs(lengths - 1).max() > 1e-3:
        worst = int(np.abs(lengths - 1).argmax())
        raise ShapeError(
            f"the normal of contact {worst} has length {lengths[worst]:.3g}", hint="Normals are unit vectors"
        )
    spread_m = float(np.ptp(points_m, axis=0).max())
    if spread_m > LARGEST_SPREAD_m:
        raise ShapeError(
            f"contacts spread over {spread_m:.3g} m", hint="Coordinates are in metres; are these millimetres?"
        )
