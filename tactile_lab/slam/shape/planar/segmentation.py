"""Divides contacts in the plane into the straight faces on which they lie.

The contacts are ordered along a provisional outline and divided into runs by dynamic programming. A run costs the
chi-square of its points against one line and of its normals against the line's; every face costs the penalty of the
Bayesian information criterion (BIC) for its three parameters: direction, offset and where it begins. The usual form of
the criterion assumes a prior as informative as one contact. Here a face may have any direction and any offset within
the reach of a hand, so the penalty includes the widths of these priors as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.planar.runs import cheapest_division, run_costs
from tactile_lab.slam.shape.surfaces.sampling import polygon_area, sample_polygon

PARAMETERS_PER_FACE = 3
"""Direction, offset, and the position along the outline where it begins."""

PRIOR_REACH_m = 0.100
"""Width of the prior range of a face's offset."""

_ORDER_STEP_m = 0.0005
_REORDERINGS = 3


@dataclass(frozen=True)
class Faces:
    """Contacts divided into straight faces, numbered counter-clockwise along the outline.

    Attributes:
        labels: face of each contact, shape (n,).
        directions_rad: angle of each face's outward normal u, shape (s,).
        offsets_m: each face is the line ``u . x = offset``, shape (s,).
        order: indices of the contacts in cyclic order along the outline, counter-clockwise, shape (n,); starts with
            the contacts of face 0.
        chi_square: misfit of all points and normals.
        direction_groups: faces of the same number share one direction up to quarter turns, shape (s,).
        regularity_nats: log evidence of the shared directions without their misfit: the gain from the angles that need
            not be estimated.
    """

    labels: NDArray[np.int64]
    directions_rad: Array
    offsets_m: Array
    order: NDArray[np.int64]
    chi_square: float
    direction_groups: NDArray[np.int64]
    regularity_nats: float = 0.0

    @property
    def count(self) -> int:
        return len(self.offsets_m)

    @property
    def normals(self) -> Array:
        """Outward unit normals, shape (s, 2)."""
        return np.column_stack([np.cos(self.directions_rad), np.sin(self.directions_rad)])

    @property
    def tangents(self) -> Array:
        """Unit vectors along the outline, counter-clockwise, shape (s, 2)."""
        return np.column_stack([-np.sin(self.directions_rad), np.cos(self.directions_rad)])

    def members(self, face: int) -> NDArray[np.int64]:
        """The contacts of a face in their order along the outline."""
        return np.asarray(self.order[self.labels[self.order] == face])


@dataclass(frozen=True)
class PlanarContacts:
    """Contacts with the standard deviations that determine their weights.

    Attributes:
        points_m, normals: shape (n, 2).
        point_sigma_m: shape (n,), along the normal.
        normal_sigma_rad: shape (n,).
    """

    points_m: Array
    normals: Array
    point_sigma_m: Array
    normal_sigma_rad: Array

    def __len__(self) -> int:
        return len(self.points_m)

    @classmethod
    def of(
        cls, points_m: Array, normals: Array, point_sigma_m: Array | float, normal_sigma_rad: Array | float
    ) -> PlanarContacts:
        """Contacts with one standard deviation for all, or one for each.

        Raises:
            ShapeError: arrays do not match, are not in the plane, or sigmas are not positive.
        """
        points_m, normals = np.asarray(points_m, dtype=float), np.asarray(normals, dtype=float)
        if points_m.ndim != 2 or points_m.shape[1] != 2 or normals.shape != points_m.shape or len(points_m) == 0:
            raise ShapeError(f"faces need contacts in the plane, got points {points_m.shape}, normals {normals.shape}")
        count = (len(points_m),)
        sigmas = [np.broadcast_to(np.asarray(each, float), count) for each in (point_sigma_m, normal_sigma_rad)]
        if min(float(each.min()) for each in sigmas) <= 0:
            raise ShapeError("faces need contacts with standard deviations above zero")
        return cls(points_m, normals, *sigmas)

    def select(self, mask: NDArray[np.bool_]) -> PlanarContacts:
        """The contacts selected by a boolean array."""
        return PlanarContacts(
            self.points_m[mask], self.normals[mask], self.point_sigma_m[mask], self.normal_sigma_rad[mask]
        )


def segment(contacts: PlanarContacts, contour_m: Array) -> Faces:
    """Divide contacts into straight faces with the least BIC.

    Args:
        contacts: all contacts of an object.
        contour_m: a provisional closed outline, shape (m, 2), in any orientation. It only orders the contacts, and is
            replaced by the faces as soon as these form an outline themselves.

    Raises:
        ShapeError: the outline has fewer than three points.
    """
    if len(contour_m) < 3:
        raise ShapeError("the outline that orders the contacts has less than three points")
    faces = divide(contacts, order_along(contacts, contour_m))
    for _ in range(_REORDERINGS):
        again = divide(contacts, order_along_faces(contacts, faces))
        if description_length(contacts, again) >= description_length(contacts, faces) - 1e-9:
            break
        faces = again
    return faces


def price_of_face(point_sigma_m: Array, normal_sigma_rad: Array) -> float:
    """Chi-square that an additional face must save, for contacts with these standard deviations, each of shape (n,).

    Twice the logarithm of the factor by which the contacts narrow the priors: ``sqrt(n) width / (sqrt(2 pi) sigma)``
    for direction and offset each, and n for the start, which is one of n positions.
    """
    widths = np.array([2 * np.pi / np.median(normal_sigma_rad), PRIOR_REACH_m / np.median(point_sigma_m)])
    narrowing = np.log(np.maximum(widths / np.sqrt(2 * np.pi), 1.0)).sum()
    return float(PARAMETERS_PER_FACE * np.log(max(len(point_sigma_m), 2)) + 2 * narrowing)


def description_length(contacts: PlanarContacts, faces: Faces) -> float:
    """Chi-square plus the penalty of the faces: smaller is better."""
    return faces.chi_square + faces.count * price_of_face(contacts.point_sigma_m, contacts.normal_sigma_rad)


def log_evidence(chi_square: float, face_count: int, point_sigma_m: Array, normal_sigma_rad: Array) -> float:
    """Logarithm of the probability of the contacts by the Bayesian information criterion.

    The Gaussian log likelihood of each contact's value and of both components of its normal, minus half the penalty of
    the faces: comparable with :meth:`Gpis.log_marginal_likelihood` of the same contacts with normals.

    Args:
        chi_square: misfit of all values and normals.
        face_count: number of faces.
        point_sigma_m, normal_sigma_rad: of each contact, shape (n,).
    """
    count = len(point_sigma_m)
    scale = np.log(point_sigma_m).sum() + 2 * np.log(normal_sigma_rad).sum() + 1.5 * count * np.log(2 * np.pi)
    price = price_of_face(point_sigma_m, normal_sigma_rad)
    return float(-0.5 * (chi_square + face_count * price) - scale)


def order_along(contacts: PlanarContacts, contour_m: Array) -> NDArray[np.int64]:
    """The contacts in cyclic order along an outline, counter-clockwise.

    Each contact is assigned to the point that fits best in position and normal together, so that the two sides of a
    thin wall are distinguished.
    """
    places = sample_polygon(contour_m if polygon_area(contour_m) > 0 else contour_m[::-1], _ORDER_STEP_m)
    along = np.roll(places, -1, axis=0) - np.roll(places, 1, axis=0)
    outward = np.column_stack([along[:, 1], -along[:, 0]])
    outward /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), np.finfo(float).tiny)
    squared = np.sum((contacts.points_m[:, None] - places[None]) ** 2, axis=2)
    misfit = squared / contacts.point_sigma_m[:, None] ** 2
    misfit += 2 * (1 - contacts.normals @ outward.T) / contacts.normal_sigma_rad[:, None] ** 2
    return np.argsort(misfit.argmin(axis=1), kind="stable")


def order_along_faces(contacts: PlanarContacts, faces: Faces) -> NDArray[np.int64]:
    """The contacts in cyclic order along faces: each at the face that fits it best within the extent of its
    contacts.
    """
    along = contacts.points_m @ faces.tangents.T
    extents = [along[faces.labels == face, face] for face in range(faces.count)]
    beyond = np.column_stack(
        [
            np.maximum(0.0, np.maximum(extent.min() - along[:, face], along[:, face] - extent.max()))
            for face, extent in enumerate(extents)
        ]
    )
    across = contacts.points_m @ faces.normals.T - faces.offsets_m
    misfit = (across**2 + beyond**2) / contacts.point_sigma_m[:, None] ** 2
    misfit += 2 * (1 - contacts.normals @ faces.normals.T) / contacts.normal_sigma_rad[:, None] ** 2
    best = misfit.argmin(axis=1)
    return np.lexsort((along[np.arange(len(contacts)), best], best))


def divide(contacts: PlanarContacts, order: NDArray[np.int64]) -> Faces:
    """The cheapest division of contacts in a given cyclic order.

    The cycle is opened where successive normals differ most, and then again at a border found on the other side, so
    that the opening does not cut a face.
    """
    normals = contacts.normals[order]
    opening = int(np.argmin(np.sum(normals * np.roll(normals, 1, axis=0), axis=1)))
    first, borders = _divide_opened(contacts, np.roll(order, -opening))
    opposite = int(borders[len(borders) // 2])
    if opposite in (0, len(order)):
        return first
    second, _ = _divide_opened(contacts, np.roll(order, -opening - opposite))
    return min(first, second, key=lambda faces: description_length(contacts, faces))


def _divide_opened(contacts: PlanarContacts, order: NDArray[np.int64]) -> tuple[Faces, NDArray[np.int64]]:
    costs, angles, offsets = _runs(contacts, order)
    _, firsts = cheapest_division(costs, price_of_face(contacts.point_sigma_m, contacts.normal_sigma_rad))
    borders = [len(order)]
    while borders[-1] > 0:
        borders.append(int(firsts[borders[-1]]))
    borders_up = np.array(borders[::-1], dtype=np.int64)
    begin, end = borders_up[:-1], borders_up[1:] - 1
    labels = np.empty(len(order), dtype=np.int64)
    labels[order] = np.repeat(np.arange(len(begin)), np.diff(borders_up))
    chi_square, numbers = float(costs[begin, end].sum()), np.arange(len(begin))
    return Faces(labels, angles[begin, end], offsets[begin, end], order, chi_square, numbers), borders_up


def _runs(contacts: PlanarContacts, order: NDArray[np.int64]) -> tuple[Array, Array, Array]:
    """Chi-square, direction and offset of every run of successive contacts; see :func:`run_costs`."""
    centre = contacts.points_m.mean(axis=0)
    costs, angles, offsets = run_costs(
        np.ascontiguousarray(contacts.points_m[order] - centre),
        np.ascontiguousarray(contacts.normals[order]),
        contacts.point_sigma_m[order] ** -2.0,
        contacts.normal_sigma_rad[order] ** -2.0,
    )
    return costs, angles, offsets + centre[0] * np.cos(angles) + centre[1] * np.sin(angles)
