"""A solid of revolution: a profile that turns about a vertical axis, as that of a bottle, a cup, a bowl or a tin.

Contacts at all angles belong to one profile, a smooth field over the distance from the axis and the height. It has ten
times as many contacts as a field in space has nearby, enough for a wall of 4 mm or a rim. The axis is where the lines
along the normals meet, improved by the evidence of the profile.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.floating import standing
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.known_places import LARGEST_SHARE_FILLED, FREE_SIGMA_m, in_one_piece, outside_at
from tactile_lab.slam.shape.fields.posterior import Prediction
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.shape.planar.outlines import encloses
from tactile_lab.slam.shape.planar.segmentation import PlanarContacts
from tactile_lab.slam.shape.planar.sided_section import SidedSection
from tactile_lab.slam.shape.solids.axis import LARGEST_GAP_rad, find_axis, misfit_around, split, to_profile
from tactile_lab.slam.shape.solids.mesh import area_weighted_normals
from tactile_lab.slam.shape.solids.planes import WeightedContacts
from tactile_lab.slam.shape.solids.polyhedron import contacts_of
from tactile_lab.slam.shape.solids.revolving import beside_foot, both_halves, generatrix, revolve
from tactile_lab.slam.shape.surfaces.sampling import distances_to_polygon
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh, extract_contour

_LARGEST_MISFIT = 2.0
"""Largest mean square, in variances, of what normals have across the planes through the axis; about one if it exists.
A hexagonal prism has 9, and is not worth the search for its profile.
"""
_AXIS_RANGE_m = 0.1
"""Prior range of the axis: about the size of objects that a hand explores."""
_AXIS_STEP_m, _AXIS_TOLERANCE_m, _EVIDENCE_TOLERANCE, _AXIS_TRIES = 0.0005, 2e-5, 0.02, 40
_KERNEL_STEPS = 20
_SECTION_GRID_m = 0.001
_SPACING = 1.5


@dataclass(frozen=True)
class Turned:
    """A solid of revolution; implements FittedShape. Made by :meth:`fit`.

    Attributes:
        axis_m: where the axis stands, shape (2,).
        axis_sigma_m: its standard deviation along each direction.
        half: the field of the profile, contacts at (distance from the axis, height).
        free_m: places known to be outside, in the same coordinates, shape (k, 2).
        floor_m: height of the table; None for an axis that does not stand on it.
        log_evidence: that of the profile and of normals in planes through the axis, minus the price of the axis.
        sides: the profile as straight and round sides, if contacts are likelier with them than with a smooth one.
        name: "turned".
    """

    axis_m: Array
    axis_sigma_m: float
    half: Gpis
    free_m: Array
    floor_m: float | None
    log_evidence: float
    sides: SidedSection | None = None
    name: str = "turned"

    @classmethod
    def fit(
        cls,
        gpis: Gpis,
        floor_m: float | None,
        free_points_m: Array | None = None,
        largest_gap_rad: float = LARGEST_GAP_rad,
    ) -> Self:
        """Fit axis and profile to the contacts of a field.

        Args:
            gpis: a field fitted in space.
            floor_m: height of the table that the object stands on; None if nothing is known of its lower end.
            free_points_m: places that a finger went through, shape (k, 3), or None.
            largest_gap_rad: largest angle at the axis between neighbouring contacts.

        Raises:
            ShapeError: the contacts are in the plane, do not surround an axis, or their normals do not meet it.
        """
        contacts = contacts_of(gpis)
        start_m, sigma_m = _met_axis(contacts, largest_gap_rad)
        axis_m, spread_m = _likeliest_axis(gpis, contacts, start_m)
        half = _half(gpis.settings, contacts, axis_m).optimise(max_iterations=_KERNEL_STEPS)
        price = 2 * np.log(_AXIS_RANGE_m / (np.sqrt(2 * np.pi) * sigma_m))
        evidence = half.log_marginal_likelihood() + misfit_around(contacts, axis_m)[1] - price
        free_m = np.empty((0, 3)) if free_points_m is None else np.reshape(free_points_m, (-1, 3))
        smooth = cls(axis_m, min(spread_m, sigma_m), half, to_profile(free_m, axis_m), floor_m, float(evidence))
        return smooth._or_sided()

    def _or_sided(self) -> Self:
        """The same with sides, if they exist and are likelier than the smooth profile."""
        if self.floor_m is None:
            return self
        seen = self.half.observations
        contacts = PlanarContacts.of(self.half.contacts_m, self.half.normals, seen.value_sigma_m, seen.gradient_sigma)
        try:
            line_m, _ = generatrix(self._smooth_section, self.floor_m, _SECTION_GRID_m)
            sides = SidedSection.of(contacts, line_m, self.floor_m)
        except ShapeError:  # the smooth profile remains
            return self
        gained = sides.log_evidence - self.half.log_marginal_likelihood()
        return (
            self
            if gained <= 0 or self._fills(sides)
            else replace(self, sides=sides, log_evidence=self.log_evidence + gained)
        )

    def _fills(self, sides: SidedSection) -> bool:
        """Whether sides enclose more than a few of the places that are known to be outside."""
        if not len(self.free_m):
            return False
        outline_m = sides.contour(_SECTION_GRID_m).points_m
        deep = encloses(outline_m, self.free_m) & (distances_to_polygon(self.free_m, outline_m) > FREE_SIGMA_m)
        return float(deep.mean()) > LARGEST_SHARE_FILLED

    @cached_property
    def _smooth_section(self) -> Contour:
        return extract_contour(self.profile, resolution_m=_SECTION_GRID_m)

    @cached_property
    def profile(self) -> Gpis:
        """The field of the whole section through the axis, with all that is known of places without contacts."""
        section = both_halves(self.half, self.floor_m)
        free_m = self.free_m
        if self.floor_m is not None:
            section = standing(section, self.floor_m)
            free_m = np.vstack([free_m, beside_foot(self.half, self.floor_m)])
        return in_one_piece(outside_at(section, np.vstack([free_m, free_m * [-1, 1]])), _SECTION_GRID_m)

    def half_of(self, contacts: WeightedContacts, chosen: NDArray[np.bool_]) -> Gpis:
        """The field of the profile of some contacts in space, about this axis and with this kernel."""
        return half_like(self.half, contacts.of(np.flatnonzero(chosen)), self.axis_m)

    def predict(self, points_m: Array) -> Prediction:
        """The field of the profile, with its gradient, at points of shape (q, 3)."""
        found = self.profile.predict(to_profile(points_m, self.axis_m), gradient=True)
        arms_m = points_m[:, :2] - self.axis_m
        out = arms_m / np.maximum(np.linalg.norm(arms_m, axis=1, keepdims=True), 1e-9)
        slope = np.column_stack([found.gradient[:, :1] * out, found.gradient[:, 1]])
        return Prediction(found.mean_m, slope, found.variance_m2)

    def contour(self, resolution_m: float = 0.001) -> Contour:
        """Raises ShapeError: a solid has no outline."""
        raise ShapeError("contacts in space have a surface, not an outline", hint="Ask for the mesh")

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        """The surface, watertight, its vertices about ``1.5 resolution_m`` apart; it always ends at the table, if any.

        Raises:
            ShapeError: the profile encloses nothing.
        """
        section = self._smooth_section if self.sides is None else self.sides.contour(_SECTION_GRID_m)
        step_m = _SPACING * resolution_m
        floor_m = self.floor_m if floor_m is None else floor_m
        line_m, sigma_m = generatrix(section, -np.inf if floor_m is None else floor_m, step_m)
        turned, rings = revolve(line_m, step_m)
        normals = area_weighted_normals(turned)
        sigma_m = np.hypot(sigma_m[rings], self.axis_sigma_m * np.linalg.norm(normals[:, :2], axis=1))
        vertices_m = turned.vertices_m + np.append(self.axis_m, 0.0)
        return SurfaceMesh(vertices_m, turned.triangles, sigma_m, normals, is_closed=section.is_closed)


def _likeliest_axis(gpis: Gpis, contacts: WeightedContacts, start_m: Array) -> tuple[Array, float]:
    """The axis of largest evidence, shape (2,), with the kernel that is best for the first guess; and its standard
    deviation along each direction, by the curvature there.
    """
    best = _half(gpis.settings, contacts, start_m).optimise(max_iterations=_KERNEL_STEPS)

    def cost(axis_m: Array) -> float:
        half = half_like(best, contacts, axis_m)
        return -half.log_marginal_likelihood() - misfit_around(contacts, axis_m)[1]

    simplex = start_m + _AXIS_STEP_m * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    found = minimize(
        cost,
        start_m,
        method="Nelder-Mead",
        options={
            "initial_simplex": simplex,
            "xatol": _AXIS_TOLERANCE_m,
            "fatol": _EVIDENCE_TOLERANCE,
            "maxfev": _AXIS_TRIES,
        },
    )
    return np.asarray(found.x), _spread_m(cost, found.x)


def _spread_m(cost: Callable[[Array], float], axis_m: Array) -> float:
    """Root mean square of the standard deviations of an axis with this cost; infinite if it is no minimum."""
    x, y = _AXIS_STEP_m * np.eye(2)
    here, aside = cost(axis_m), [cost(axis_m + step) + cost(axis_m - step) for step in (x, y, x + y)]
    along = np.array(aside[:2]) - 2 * here
    across = (aside[2] - 2 * here - along.sum()) / 2
    determinant = along.prod() - across**2
    if along.min() <= 0 or determinant <= 0:
        return np.inf
    return float(_AXIS_STEP_m * np.sqrt(along.mean() / determinant))


def rough_half(
    settings: GpisSettings, contacts: WeightedContacts, largest_gap_rad: float = LARGEST_GAP_rad
) -> tuple[Gpis, Array]:
    """The profile with its best kernel and noise about the axis that normals alone tell, and that axis, shape (2,).

    Raises:
        ShapeError: as :meth:`Turned.fit`.
    """
    axis_m, _ = _met_axis(contacts, largest_gap_rad)
    return _half(settings, contacts, axis_m).optimise(noise=True, max_iterations=_KERNEL_STEPS), axis_m


def half_like(half: Gpis, contacts: WeightedContacts, axis_m: Array) -> Gpis:
    """The profile of other contacts or about another axis, with the kernel and the noise of one."""
    return half.refit(*_seen_from(contacts, axis_m), half.noise_scale)


def _met_axis(contacts: WeightedContacts, largest_gap_rad: float) -> tuple[Array, float]:
    """As :func:`find_axis`. Raises ShapeError also if the normals do not meet it."""
    axis_m, sigma_m = find_axis(contacts, largest_gap_rad)
    if misfit_around(contacts, axis_m)[0] > _LARGEST_MISFIT:
        raise ShapeError("the contacts' normals do not meet one vertical axis")
    return axis_m, sigma_m


def _half(settings: GpisSettings, contacts: WeightedContacts, axis_m: Array) -> Gpis:
    """The field of the profile from the contacts, all at positive distances."""
    return Gpis.fit(*_seen_from(contacts, axis_m), settings)


def _seen_from(contacts: WeightedContacts, axis_m: Array) -> tuple[Array, Array, Array, Array]:
    """Places and normals of contacts in planes through an axis, shape (n, 2), and their standard deviations."""
    normals, _ = split(contacts, axis_m)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    sigmas = contacts.point_weights**-0.5, contacts.normal_weights**-0.5
    return to_profile(contacts.points_m, axis_m), normals, *sigmas
