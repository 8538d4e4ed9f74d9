"""A solid of revolution that lies or leans: a bottle on its side, half a cylinder on its flat face, a mug on a bulged
foot.

Seen along the axis it is like one that stands (:mod:`tactile_lab.slam.shape.solids.turned`). Below what lies the table
closes nothing: it only cuts off what would be below. The axis is the one that the contacts' normals pass nearest by.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from gtsam import Rot3
from scipy.optimize import minimize, minimize_scalar

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.model import FittedShape
from tactile_lab.slam.shape.solids.axis import SIDEWAYS, find_axis, misfit_around, squares_around
from tactile_lab.slam.shape.solids.planes import WeightedContacts
from tactile_lab.slam.shape.solids.polyhedron import contacts_of
from tactile_lab.slam.shape.solids.turned import Turned, half_like, rough_half
from tactile_lab.slam.shape.solids.turned_with_part import LEAST_OF_PARTS, Division
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

_LARGEST_GAP_rad = np.deg2rad(220.0)
"""No finger comes below what lies on a table."""

_NOISE_PRICE_nats = 1.0
"""Of a parameter that a solid that stands does not have (Akaike's criterion)."""

_STEP_rad, _SEARCHED_rad, _TOLERANCE_rad = np.deg2rad([2.0, 4.0, 0.1])
"""Of headings that are compared by misfit; how far around the best the likeliest is looked for, and how closely."""

_LEAST_LEAN_rad, _LARGEST_LEAN_rad, _LEAN_STEP_rad = np.deg2rad([2.0, 20.0, 5.0])
"""Of an axis that leans and does not stand, and steps in which it is looked for."""

_OUTLYING, _LARGEST_MISFIT = 9.0, 2.0
"""Squares of normals, in variances, that count no more, and their mean where no axis leans so."""

_LEAN_TRIES, _LEAN_ROUNDS, _SIMPLEX_rad, _FLAT = 80, 2, np.deg2rad(1.5), 0.01
_LEAST_CONTACTS = 40
"""Fewer on an ellipsoid fit some solid that leans as well."""

_MOVED_m = 0.040
"""An axis that moves aside by as much as one that leans by a radian more."""

_LOW = 0.25
"""Share of the contacts on walls that tell how wide the foot is."""


@dataclass(frozen=True)
class _Tipped:
    """A solid of revolution whose axis is not upright.

    Attributes:
        along: axes of a frame whose z is the axis, as rows, shape (3, 3).
        body: the solid in that frame, with parts beside it perhaps.
        floor_m: height of the table.
        log_evidence: of the body, minus the price of the axis' direction.
    """

    along: Array
    body: FittedShape
    floor_m: float
    log_evidence: float

    def contour(self, resolution_m: float = 0.001) -> Contour:
        """Raises ShapeError: a solid has no outline."""
        raise ShapeError("contacts in space have a surface, not an outline", hint="Ask for the mesh")

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        """The surface, watertight; it always ends at the table.

        Raises:
            ShapeError: the profile encloses nothing.
        """
        return _back(self.body.mesh(resolution_m), self.along).above(self.floor_m if floor_m is None else floor_m)


@dataclass(frozen=True)
class Lying(_Tipped):
    """A solid of revolution with a horizontal axis, the frame's y up; implements FittedShape. Made by :meth:`fit`.

    Attributes:
        name: "lying turned".
    """

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


@dataclass(frozen=True)
class Leaning(_Tipped):
    """A solid of revolution whose axis leans, with parts beside it or without; implements FittedShape. Made by
    :meth:`fit`.
    """

    @classmethod
    def fit(cls, gpis: Gpis, floor_m: float, free_points_m: Array | None = None) -> Self:
        """Fit lean, axis, profile and parts to the contacts of a field.

        Raises:
            ShapeError: the contacts surround no axis that leans, or their normals do not meet it.
        """
        contacts = contacts_of(gpis)
        along = _leaning(gpis, contacts)
        free_m = None if free_points_m is None else np.reshape(free_points_m, (-1, 3)) @ along.T
        foot_m = _foot_m(_rotated(contacts, along), along @ [0.0, 0.0, 1.0], floor_m)
        division = Division.of(_seen_by(gpis, along), foot_m, free_m)
        has_parts = division.impossible >= LEAST_OF_PARTS
        body = division.with_parts(foot_m, free_m) if has_parts else division.without_strays()
        sigma_rad = float(contacts.normal_weights.sum() ** -0.5)
        price = 2 * np.log(2 * _LARGEST_LEAN_rad / (np.sqrt(2 * np.pi) * sigma_rad))
        return cls(along, body, floor_m, float((body.log_evidence or 0.0) - price))

    @property
    def name(self) -> str:
        """Of the solid, "leaning"."""
        return f"leaning {self.body.name}"


def _leaning(gpis: Gpis, contacts: WeightedContacts) -> Array:
    """Axes of the frame whose z is the likeliest axis near the one that normals pass nearest by, as rows.

    Raises:
        ShapeError: there is none, or it stands, or contacts are too few.
    """
    if len(contacts) < _LEAST_CONTACTS:
        raise ShapeError(f"{len(contacts)} contacts are too few for an axis that leans")
    leans = np.arange(-_LARGEST_LEAN_rad, _LARGEST_LEAN_rad + 1e-9, _LEAN_STEP_rad)
    grid = [np.array([x, y]) for x in leans for y in leans if np.hypot(x, y) <= _LARGEST_LEAN_rad + 1e-9]
    start = min(grid, key=lambda lean: _lean_misfit(lean, contacts))
    lean = _nearest(lambda lean: _lean_misfit(lean, contacts), start)
    if _lean_misfit(lean, contacts) > _LARGEST_MISFIT:
        raise ShapeError("the contacts' normals do not meet an axis that leans")
    seen = _rotated(contacts, _tilted(lean))
    met = squares_around(seen, find_axis(seen)[0])[0] < _OUTLYING
    body = contacts.of(np.flatnonzero(met))
    for _ in range(_LEAN_ROUNDS):
        lean = _likeliest_lean(gpis, body, lean)
    if not _LEAST_LEAN_rad < np.linalg.norm(lean) < _LARGEST_LEAN_rad:
        raise ShapeError("no axis leans")
    return _tilted(lean)


def _likeliest_lean(gpis: Gpis, body: WeightedContacts, lean: Array) -> Array:
    """The lean of largest evidence near another one, with the kernel that is best for that."""
    rough, start_m = rough_half(gpis.settings, _rotated(body, _tilted(lean)))
    middle_m = np.append(start_m, rough.contacts_m[:, 1].mean()) @ _tilted(lean)

    def cost(moved: Array) -> float:
        along = _tilted(moved[:2])
        turned, axis_m = _rotated(body, along), (along @ middle_m)[:2] + moved[2:] * _MOVED_m
        return -half_like(rough, turned, axis_m).log_marginal_likelihood() - misfit_around(turned, axis_m)[1]

    return _nearest(cost, np.append(lean, [0.0, 0.0]))[:2]


def _nearest(cost: Callable[[Array], float], start: Array) -> Array:
    """Where a cost of angles is least, near a start."""
    simplex = start + _SIMPLEX_rad * np.vstack([np.zeros(len(start)), np.eye(len(start))])
    found = minimize(
        cost,
        start,
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": _TOLERANCE_rad, "fatol": _FLAT, "maxfev": _LEAN_TRIES},
    )
    return np.asarray(found.x)


def _lean_misfit(lean: Array, contacts: WeightedContacts) -> float:
    """Mean square, in variances, of what normals have across the planes through an axis; outliers count little."""
    seen = _rotated(contacts, _tilted(lean))
    try:
        squares, _ = squares_around(seen, find_axis(seen)[0])
    except ShapeError:  # they surround nothing
        return np.inf
    return float(np.minimum(squares, _OUTLYING).mean())


def _tilted(lean: Array) -> Array:
    """Axes of a frame that is turned about two horizontal axes, as rows, shape (3, 3)."""
    return np.asarray(Rot3.Expmap(np.append(lean, 0.0)).matrix())


def _foot_m(contacts: WeightedContacts, up: Array, floor_m: float) -> float:
    """Height along the axis at which a foot as wide as the lowest walls meets the table with its lower edge."""
    axis_m, _ = find_axis(contacts)
    walls = contacts.points_m[np.linalg.norm(contacts.normals[:, :2], axis=1) > SIDEWAYS]
    lowest = walls[np.argsort(walls[:, 2])[: max(1, int(_LOW * len(walls)))]]
    radius_m = float(np.median(np.linalg.norm(lowest[:, :2] - axis_m, axis=1)))
    aside = float(np.linalg.norm(up[:2]))
    return float((floor_m - up[:2] @ axis_m + radius_m * aside) / up[2])


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
    free_m = None if free_points_m is None else np.reshape(free_points_m, (-1, 3)) @ along.T
    body = Turned.fit(_seen_by(gpis, along), None, free_m, _LARGEST_GAP_rad)
    half = body.half.optimise(noise=True)
    gained = half.log_marginal_likelihood() - body.half.log_marginal_likelihood() - _NOISE_PRICE_nats
    return body if gained < 0 else replace(body, half=half, log_evidence=body.log_evidence + gained)


def _seen_by(gpis: Gpis, along: Array) -> Gpis:
    """The field of the contacts in another frame."""
    seen = gpis.observations
    sigmas = seen.value_sigma_m[: len(gpis.contacts_m)], seen.gradient_sigma
    return gpis.refit(gpis.contacts_m @ along.T, gpis.normals @ along.T, *sigmas)


def _back(mesh: SurfaceMesh, along: Array) -> SurfaceMesh:
    """A surface out of another frame."""
    return replace(mesh, vertices=mesh.vertices @ along, normals=mesh.normals @ along)


def _rotated(contacts: WeightedContacts, along: Array) -> WeightedContacts:
    """Contacts in another frame."""
    return replace(contacts, points_m=contacts.points_m @ along.T, normals=contacts.normals @ along.T)


def _seen_along(heading_rad: float) -> Array:
    """Axes of a frame whose z has a heading and whose y is up, as rows, shape (3, 3)."""
    cosine, sine = np.cos(heading_rad), np.sin(heading_rad)
    return np.array([[-sine, cosine, 0.0], [0.0, 0.0, 1.0], [cosine, sine, 0.0]])
