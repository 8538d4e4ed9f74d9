"""The likeliest solid of revolution: standing, lying, or with parts beside it."""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.model import FittedShape
from tactile_lab.slam.shape.selection.contradictions import checked_evidence, try_make
from tactile_lab.slam.shape.solids.lying import Leaning, Lying
from tactile_lab.slam.shape.solids.turned import Turned
from tactile_lab.slam.shape.solids.turned_with_part import LEAST_OF_PARTS, Division

_LARGEST_SHARE_OFF, _LARGEST_SHARE_OFF_WITH_PART = 0.01, 0.05


def revolving(gpis: Gpis, free_points_m: Array | None, floor_m: float, *, at_least: float) -> FittedShape | None:
    """The solid of revolution, standing or lying, with a part beside it or without, whichever has most evidence; None
    if none has enough.
    """
    without = gpis.settings.without
    if "turned" in without:
        return None
    body: FittedShape | None = _turned(gpis, free_points_m, floor_m, at_least=at_least)
    least = 0 if body is None else LEAST_OF_PARTS
    division = None if without >= {"parts", "strays"} else _division(gpis, free_points_m, floor_m, least)
    if body is None and division is not None and "strays" not in without:
        body = _turned_but_for_strays(division, free_points_m, floor_m, at_least=at_least)
    most = at_least if body is None or body.log_evidence is None else body.log_evidence
    lying = _lying(gpis, free_points_m, floor_m, at_least=most)
    body, most = (body, most) if lying is None else (lying, lying.log_evidence)
    if division is not None and "parts" not in without:
        body = _turned_with_part(division, free_points_m, floor_m, at_least=most) or body
    return body or _leaning(gpis, free_points_m, floor_m, at_least=at_least)


def _division(gpis: Gpis, free_points_m: Array | None, floor_m: float, least: int) -> Division | None:
    try:
        return Division.of(gpis, floor_m, free_points_m, least=least)
    except ShapeError:  # nothing here turns about an axis, or all of it does
        return None


def _turned(gpis: Gpis, free_points_m: Array | None, floor_m: float, *, at_least: float) -> Turned | None:
    """The solid of revolution, if it has more evidence and hardly any contact is off its surface.

    Its evidence is a marginal likelihood like the field's, so that no cross-validation is needed. A handle has only a
    few contacts: the body may well be likelier without them, but then the handle would be missing.
    """
    shape = try_make(lambda: Turned.fit(gpis, floor_m, free_points_m))
    if not isinstance(shape, Turned):
        return None
    off = _LARGEST_SHARE_OFF
    evidence = checked_evidence(shape, gpis, free_points_m, floor_m, at_least=at_least, largest_share_off=off)
    return shape if evidence > at_least else None


def _turned_but_for_strays(
    division: Division, free_points_m: Array | None, floor_m: float, *, at_least: float
) -> Turned | None:
    """The solid of revolution that a few wrong contacts hide, as :func:`_turned`: a field bulges at each of them."""
    shape = try_make(division.without_strays)
    if not isinstance(shape, Turned):
        return None
    off, others = _LARGEST_SHARE_OFF, division.gpis.of_some(np.flatnonzero(~division.beside))
    evidence = checked_evidence(shape, others, free_points_m, floor_m, at_least=at_least, largest_share_off=off)
    return shape if evidence > at_least else None


def _lying(gpis: Gpis, free_points_m: Array | None, floor_m: float, *, at_least: float) -> Lying | None:
    """The solid of revolution that lies, as :func:`_turned`. What its noise explains is no stray."""
    shape = try_make(lambda: Lying.fit(gpis, floor_m, free_points_m))
    if not isinstance(shape, Lying):
        return None
    off = _LARGEST_SHARE_OFF
    checked = checked_evidence(shape, gpis, free_points_m, floor_m, at_least=at_least, largest_share_off=off)
    return shape if np.isfinite(checked) else None


def _leaning(gpis: Gpis, free_points_m: Array | None, floor_m: float, *, at_least: float) -> FittedShape | None:
    """The solid of revolution that leans, with a part or without, if none stands or lies, as :func:`_lying`."""
    if not np.isfinite(at_least) or not gpis.settings.without.isdisjoint({"parts", "strays"}):
        return None
    shape = try_make(lambda: Leaning.fit(gpis, floor_m, free_points_m))
    if shape is None:
        return None
    off = _LARGEST_SHARE_OFF_WITH_PART
    checked = checked_evidence(shape, gpis, free_points_m, floor_m, at_least=at_least, largest_share_off=off)
    return shape if np.isfinite(checked) else None


def _turned_with_part(
    division: Division, free_points_m: Array | None, floor_m: float, *, at_least: float
) -> FittedShape | None:
    """The solid of revolution with a part beside it, if it has more evidence, as :func:`_turned`."""
    shape = try_make(lambda: division.with_parts(floor_m, free_points_m))
    if shape is None:
        return None
    off = _LARGEST_SHARE_OFF_WITH_PART
    evidence = checked_evidence(shape, division.gpis, free_points_m, floor_m, at_least=at_least, largest_share_off=off)
    return shape if evidence > at_least else None
