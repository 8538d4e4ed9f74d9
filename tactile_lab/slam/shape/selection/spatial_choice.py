"""Chooses the model that describes a solid best, by the evidence of contacts: smooth field, flat faces, vertical walls,
or a profile that turns about an axis.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.drawn_field import DrawnField, PRICE_nats
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.gpis_shape import GpisShape
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.shape.fields.standing_field import StandingField
from tactile_lab.slam.shape.model import FittedShape
from tactile_lab.slam.shape.selection.contradictions import (
    LARGEST_SHARE_OFF,
    COARSE_m,
    LEFT_OUT_nats,
    checked_evidence,
    try_make,
)
from tactile_lab.slam.shape.selection.held_out import predicts_better, predicts_better_than
from tactile_lab.slam.shape.selection.round_choice import revolving
from tactile_lab.slam.shape.selection.unexplained import unexplained
from tactile_lab.slam.shape.solids.hollow import Hollow, are_entered, felt_inside, hollowed
from tactile_lab.slam.shape.solids.lying import Lying
from tactile_lab.slam.shape.solids.planes import divide
from tactile_lab.slam.shape.solids.polyhedron import Polyhedron, contacts_of
from tactile_lab.slam.shape.solids.prism import Prism
from tactile_lab.slam.shape.solids.turned import Turned
from tactile_lab.slam.shape.solids.turned_with_part import Division
from tactile_lab.slam.shape.solids.with_parts import ONE_PART_m, WithParts
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh

_OUTSIDE_m = 0.012
"""Contacts so far outside of a surface, several of them near each other, are no noise."""
_KERNEL_STEPS = 10
_LARGEST_SHARE_OFF_HOLLOW = 0.05
"""Of the contacts, off the surface of a hollow body. With more of them a solid with flat faces or upright walls that
has them all is believed: what is between the arms of an L is no cavity. A field has every contact, and tells nothing.
"""

_BEYOND_DOUBT_nats = 3.0
"""A sharp solid that explains each contact this much better than the field is accepted at once. No curved object came
near this value (2.7 at most), cross-validation takes time, and with contacts held out a face with few contacts may be
missing.
"""

OutlineChoice = Callable[[Gpis, "Array | None"], FittedShape]
Fit = Callable[[Gpis], FittedShape]


def best_spatial_shape(
    field: FittedShape,
    gpis: Gpis,
    best_outline: OutlineChoice,
    free_points_m: Array | None = None,
    floor_m: float | None = None,
) -> FittedShape:
    """The field itself, or a solid with flat faces or vertical walls if that is more probable.

    A sharp solid is accepted only if it is consistent with what is known: its contacts lie on its surface, and it does
    not fill places that fingers passed. It must also predict contacts to which it was not fitted better than the field
    does (:mod:`tactile_lab.slam.shape.selection.held_out`). Of a body into which fingers came down inside a rim,
    the outside is chosen without what they met and where they were there; what they met tells how thick the wall is. It
    is hollow unless that leaves contacts off which a sharp solid explains.

    Args:
        field: the field as a shape, used unless another model is more probable; without a table it keeps all contacts.
        gpis: the field, with its kernel at a maximum of the marginal likelihood.
        best_outline: chooses the model of an outline.
        free_points_m: places that a finger passed, shape (k, 3), or None.
        floor_m: height of the table if the object stands on one; only then vertical walls are considered, and the field
            ends at the table like :class:`StandingField`.
    """
    if floor_m is None or field.log_evidence is None:
        return _best_solid(field, gpis, best_outline, free_points_m, floor_m)
    hollow: FittedShape | None = None
    if free_points_m is not None and (entered := are_entered(gpis, free_points_m)).any():
        inside = felt_inside(gpis, free_points_m[entered])
        outside = gpis.of_some(np.flatnonzero(~inside)).optimise(max_iterations=_KERNEL_STEPS) if inside.any() else gpis
        around = GpisShape(outside), outside, best_outline, free_points_m[~entered], floor_m
        hollow = try_make(lambda: hollowed(_best_solid(*around), gpis, free_points_m, floor_m, inside))
        if isinstance(hollow, Hollow) and hollow.share_off <= _LARGEST_SHARE_OFF_HOLLOW:
            return hollow
    best = _best_solid(field, gpis, best_outline, free_points_m, floor_m)
    if isinstance(hollow, Hollow) and not isinstance(best, Polyhedron | Prism):
        return hollow
    return try_make(lambda: hollowed(best, gpis, free_points_m, floor_m)) or best


def _best_solid(
    field: FittedShape, gpis: Gpis, best_outline: OutlineChoice, free_points_m: Array | None, floor_m: float | None
) -> FittedShape:
    """The most probable model; a closed one."""
    if field.log_evidence is None:
        return field
    without = gpis.settings.without
    everything = gpis
    gpis, left_out_nats = (gpis, 0.0) if "strays" in without else _without_strays(gpis)
    if floor_m is not None and "standing field" not in without:
        field = try_make(lambda: StandingField.fit(gpis, floor_m)) or field
    sharp: Fit | None = None
    best, most = field, -np.inf if "field" in without else field.log_evidence or -np.inf
    for fit in _candidates(gpis.settings, best_outline, free_points_m, floor_m):
        shape = try_make(lambda fit=fit: fit(gpis))  # type: ignore[misc]
        if shape is None:
            continue
        evidence = checked_evidence(shape, gpis, free_points_m, floor_m, at_least=most)
        if evidence > most and _earned(fit, evidence, gpis, floor_m):
            best, most, sharp = shape, evidence, fit
    if floor_m is None:
        return best
    if not _beyond_doubt(most, gpis) and without.isdisjoint({"field", "standing field", "sections"}):
        best, most = _likelier(sectioned := _sectioned(gpis, floor_m), best, most)
        sharp = None if best is sectioned else sharp
    best = _rounder(best, sharp, everything, free_points_m, floor_m, most + left_out_nats)
    return _with_missing_parts(best, everything, free_points_m, floor_m)


def _rounder(
    best: FittedShape,
    sharp: Fit | None,
    gpis: Gpis,
    free_points_m: Array | None,
    floor_m: float,
    evidence: float,
) -> FittedShape:
    """The solid of revolution if it has more evidence than the best so far, or if that is sharp and predicts contacts
    worse: many small faces can follow a round wall.
    """
    if sharp is None:
        return revolving(gpis, free_points_m, floor_m, at_least=evidence) or best
    round_ = revolving(gpis, free_points_m, floor_m, at_least=-np.inf)
    if round_ is None:
        return best

    def turn(some: Gpis) -> FittedShape:
        if isinstance(round_, Lying):
            return Lying.fit(some, floor_m, free_points_m)
        division = Division.of(some, floor_m, free_points_m)
        return division.without_strays() if isinstance(round_, Turned) else division.with_parts(floor_m, free_points_m)

    return best if predicts_better_than(sharp, turn, gpis, COARSE_m, floor_m) else round_


def _with_missing_parts(
    shape: FittedShape, gpis: Gpis, free_points_m: Array | None, floor_m: float | None
) -> FittedShape:
    """A shape with parts where contacts near each other lie outside: they were strays, or few among many on a solid.

    Strays are left out one by one, at a price that is right for errors that have nothing to do with each other.
    """
    if not gpis.settings.without.isdisjoint({"strays", "parts"}):
        return shape
    mesh = _try_mesh(shape, floor_m)
    if mesh is None:
        return shape
    groups = unexplained(gpis.contacts_m, mesh, far_m=_OUTSIDE_m, together_m=ONE_PART_m)
    members = [group.members for group in groups if not group.is_inside and len(group.members) > 1]
    if not members:
        return shape
    beside = np.isin(np.arange(len(gpis.contacts_m)), np.concatenate(members))
    return try_make(lambda: WithParts.of(shape, gpis, beside, floor_m, free_points_m)) or shape


def _try_mesh(shape: FittedShape, floor_m: float | None) -> SurfaceMesh | None:
    try:
        return shape.mesh(COARSE_m, floor_m)
    except ShapeError:  # it encloses nothing, which is told where its surface is wanted
        return None


def _sectioned(gpis: Gpis, floor_m: float) -> FittedShape | None:
    """A standing field of what is alike along edges, its evidence reduced by the price of its parameters."""
    shape = try_make(lambda: StandingField.fit(DrawnField.along_edges(gpis), floor_m))
    return replace(shape, log_evidence=shape.log_evidence - PRICE_nats) if isinstance(shape, StandingField) else None


def _likelier(shape: FittedShape | None, best: FittedShape, most: float) -> tuple[FittedShape, float]:
    """A shape and its evidence if that is larger than that of the best so far."""
    evidence = -np.inf if shape is None or shape.log_evidence is None else shape.log_evidence
    return (shape, evidence) if shape is not None and evidence > most else (best, most)


def _beyond_doubt(evidence: float, gpis: Gpis) -> bool:
    """Whether a solid explains its contacts so much better than the field that nothing else need be asked."""
    return evidence - gpis.log_marginal_likelihood() > _BEYOND_DOUBT_nats * len(gpis.contacts_m)


def _earned(fit: Fit, evidence: float, gpis: Gpis, floor_m: float | None) -> bool:
    """Whether a sharp solid with more evidence than the field also passes the cross-validation."""
    if not gpis.settings.without.isdisjoint({"field", "held-out contacts"}):
        return True
    return _beyond_doubt(evidence, gpis) or predicts_better(fit, gpis, COARSE_m, floor_m)


def _without_strays(gpis: Gpis) -> tuple[Gpis, float]:
    """The field without contacts that share a plane with no other, if it explains the rest sufficiently better, and the
    log density of those left out.

    Every contact left out costs :data:`LEFT_OUT_nats`, so that good contacts on curved parts stay.
    """
    contacts = contacts_of(gpis)
    planes = divide(contacts)
    kept = planes.sizes[planes.labels] > 1
    if kept.all() or np.count_nonzero(~kept) > LARGEST_SHARE_OFF * len(contacts):
        return gpis, 0.0
    seen = gpis.observations
    rest = gpis.contacts_m[kept], gpis.normals[kept]
    trimmed = Gpis.fit(*rest, seen.value_sigma_m[kept], seen.gradient_sigma[kept], gpis.settings)
    trimmed = trimmed.optimise(max_iterations=_KERNEL_STEPS)
    peaks = 0.5 * np.log(contacts.point_weights) + 1.5 * np.log(contacts.normal_weights) - 2 * np.log(2 * np.pi)
    left_out = float(np.sum(peaks[~kept] - LEFT_OUT_nats))
    likelier = trimmed.log_marginal_likelihood() + left_out > gpis.log_marginal_likelihood() + LEFT_OUT_nats
    return (trimmed, left_out) if likelier else (gpis, 0.0)


def _candidates(
    settings: GpisSettings, best_outline: OutlineChoice, free_points_m: Array | None, floor_m: float | None
) -> list[Fit]:
    """Functions that fit the sharp solids to a field."""
    upright, fits = floor_m is not None, list[Fit]()
    if "polyhedron" not in settings.without:
        fits.append(lambda gpis: Polyhedron.fit(gpis, free_points_m, upright=upright))
    if upright and "prism" not in settings.without:
        fits.append(lambda gpis: Prism.fit(gpis, best_outline, free_points_m))
    return fits
