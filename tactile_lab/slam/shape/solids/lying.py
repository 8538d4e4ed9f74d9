"""A solid of revolution that lies: a bottle or a tin on its side, half a cylinder on its flat face.

Its axis is horizontal. Seen along the axis it is like one that stands (:mod:`tactile_lab.slam.shape.solids.turned`),
except that the table closes nothing: it only cuts off what would be below. The axis' heading is the one in which the
contacts' normals pass nearest by.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.optimize import minimize_scalar

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.solids.axis import find_axis, misfit_around
from tactile_lab.slam.shape.solids.planes import WeightedContacts
from tactile_lab.slam.shape.solids.polyhedron import contacts_of
from tactile_lab.slam.shape.solids.turned import Turned, half_like, rough_half
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

_LARGEST_GAP_rad = np.deg2rad(220.0)
"""No finger comes below what lies on a table."""

_NOISE_PRICE_nats = 1.0
"""Of a parameter that a solid that stands does not have (Akaike's criterion)."""

_STEP_rad, _SEARCHED_rad, _TOLERANCE_rad = np.deg2rad([2.0, 4.0, 0.1])
"""Of headings that are compared by misfit; how far around the best the likeliest is looked for, and how closely."""


@dataclass(frozen=True)
class Lying:
    """A solid of revolution with a horizontal axis; implements FittedShape. Made by :meth:`fit`.

    Attributes:
        along: axes of a frame whose z is the axis and whose y is up, as rows, shape (3, 3).
        body: the solid in that frame.
        floor_m: height of the table.
        log_evidence: of the body, minus the price of the heading.
        name: "lying turned".
    """

    along: Array
    body: Turned
    floor_m: float
    log_evidence: float
    name: str = "lying turned"

    @classmethod
    def fit(cls, gpis: Gpis, floor_m: float, free_points_m: Array | None = None) -> Self:
        """Fit heading, axis and profile to the contacts of a field; arguments and errors as of :meth:`Turned.fit`."""
        contacts = contacts_of(gpis)
        heading_rad = _heading_rad(contacts)
        along = _seen_along(_likeliest_rad(gpis, contacts, heading_rad))
        body = _turned(gpis, along, free_points_m)
        sigma_rad = float(contacts.normal_weights.sum() ** -0.5)
        price = np.log(np.pi / (np.sqrt(2 * np.pi) * sigma_rad))
        return cls(along, body, floor_m, float(body.log_evidence - price))

    def contour(self, resolution_m: float = 0.001) -> Contour:
        """Raises ShapeError: a solid has no outline."""
        raise ShapeError("contacts in space have a surface, not an outline", hint="Ask for the mesh")

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        """The surface, watertight; it always ends at the table.

        Raises:
            ShapeError: the profile encloses nothing.
        """
        mesh = self.body.mesh(resolution_m)
        back = replace(mesh, vertices=mesh.vertices @ self.along, normals=mesh.normals @ self.along)
        return back.above(self.floor_m if floor_m is None else floor_m)


def _heading_rad(contacts: WeightedContacts) -> float:
    """Of the horizontal axis that normals pass nearest by. Raises ShapeError: contacts surround none."""
    headings = np.arange(0.0, np.pi, _STEP_rad)
    misfits = [_misfit(heading, contacts) for heading in headings]
    if not np.isfinite(min(misfits)):
        raise ShapeError("the contacts do not surround a horizontal axis")
    return float(headings[int(np.argmin(misfits))])


def _misfit(heading_rad: float, contacts: WeightedContacts) -> float:
    """Mean square, in variances, of what normals have across the planes through the axis with a heading."""
    seen = _rotated(contacts, _seen_along(heading_rad))
    try:
        return misfit_around(seen, find_axis(seen, _LARGEST_GAP_rad)[0])[0]
    except ShapeError:  # with this heading they surround nothing
        return np.inf


def _likeliest_rad(gpis: Gpis, contacts: WeightedContacts, heading_rad: float) -> float:
    """The heading of largest evidence near another one, about the middle of the axis found with that.

    Raises:
        ShapeError: the contacts do not surround an axis there, or their normals do not meet it.
    """
    start = _seen_along(heading_rad)
    rough, axis_m = rough_half(gpis.settings, _rotated(contacts, start), _LARGEST_GAP_rad)
    middle_m = np.append(axis_m, rough.contacts_m[:, 1].mean()) @ start

    def cost(turned_rad: float) -> float:
        along = _seen_along(heading_rad + turned_rad)
        seen, axis_m = _rotated(contacts, along), (along @ middle_m)[:2]
        return -half_like(rough, seen, axis_m).log_marginal_likelihood() - misfit_around(seen, axis_m)[1]

    limits = -float(_SEARCHED_rad), float(_SEARCHED_rad)
    found = minimize_scalar(cost, bounds=limits, method="bounded", options={"xatol": float(_TOLERANCE_rad)})
    return heading_rad + float(found.x)


def _turned(gpis: Gpis, along: Array, free_points_m: Array | None) -> Turned:
    """The solid of revolution about the third axis of a frame, from contacts and free places outside of that frame.

    Errors of poses dent a field in space, but not a rigid body: they are noise for it, so its noise is estimated.
    """
    seen, free_m = gpis.observations, np.empty((0, 3)) if free_points_m is None else free_points_m
    sigmas = seen.value_sigma_m[: len(gpis.contacts_m)], seen.gradient_sigma
    turned = gpis.refit(gpis.contacts_m @ along.T, gpis.normals @ along.T, *sigmas)
    body = Turned.fit(turned, None, np.reshape(free_m, (-1, 3)) @ along.T, _LARGEST_GAP_rad)
    half = body.half.optimise(noise=True)
    gained = half.log_marginal_likelihood() - body.half.log_marginal_likelihood() - _NOISE_PRICE_nats
    return body if gained < 0 else replace(body, half=half, log_evidence=body.log_evidence + gained)


def _rotated(contacts: WeightedContacts, along: Array) -> WeightedContacts:
    """Contacts in another frame."""
    return replace(contacts, points_m=contacts.points_m @ along.T, normals=contacts.normals @ along.T)


def _seen_along(heading_rad: float) -> Array:
    """Axes of a frame whose z has a heading and whose y is up, as rows, shape (3, 3)."""
    cosine, sine = np.cos(heading_rad), np.sin(heading_rad)
    return np.array([[-sine, cosine, 0.0], [0.0, 0.0, 1.0], [cosine, sine, 0.0]])
