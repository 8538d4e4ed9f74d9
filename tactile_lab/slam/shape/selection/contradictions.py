"""Whether a solid contradicts what is known: contacts lie on its surface, and where fingers passed there is nothing."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.known_places import LARGEST_SHARE_FILLED, FREE_SIGMA_m
from tactile_lab.slam.shape.model import FittedShape
from tactile_lab.slam.shape.selection.unexplained import are_inside
from tactile_lab.slam.shape.solids.polyhedron import contacts_of
from tactile_lab.slam.shape.surfaces.sampling import distances_to_mesh
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh

COARSE_m = 0.006
"""Resolution of the surfaces that are compared with contacts."""

LEFT_OUT_nats = 12.0
"""Cost of a contact that is centimetres off the surface: that of one outlier among twenty good contacts."""

LARGEST_SHARE_OFF = 0.15
"""Of the contacts, off the surface of a sharp solid."""

_ON_SURFACE_m = 0.006
_NOISE_SIGMAS = 2.0


def checked_evidence(
    shape: FittedShape,
    gpis: Gpis,
    free_points_m: Array | None,
    floor_m: float | None,
    *,
    at_least: float,
    largest_share_off: float = LARGEST_SHARE_OFF,
) -> float:
    """The evidence of a solid, reduced for contacts that its planes explain but its surface excludes.

    Minus infinity if it has no surface, excludes many contacts, or fills free places. Its surface is computed only if
    the evidence can reach ``at_least``.
    """
    if shape.log_evidence is None or shape.log_evidence <= at_least:
        return -np.inf
    try:
        mesh = shape.mesh(COARSE_m, floor_m)
    except ShapeError:  # its faces enclose nothing
        return -np.inf
    away_m = distances_to_mesh(gpis.contacts_m, mesh)
    free = np.empty((0, 3)) if free_points_m is None or "contradictions" in gpis.settings.without else free_points_m
    if np.mean(away_m > _ON_SURFACE_m) > largest_share_off or _filled_share(mesh, free) > LARGEST_SHARE_FILLED:
        return -np.inf
    return shape.log_evidence - stray_cost(away_m, contacts_of(gpis).point_weights)


def stray_cost(away_m: Array, weights: Array) -> float:
    """Cost, in nats, of contacts that a solid's planes explain but its surface excludes; at most that of an outlier
    each.

    Args:
        away_m: distances of the contacts from the surface, shape (n,).
        weights: inverse variances of their noise, which the planes account for, shape (n,), 1/m^2.
    """
    beyond = np.maximum(away_m * np.sqrt(weights) - _NOISE_SIGMAS, 0.0)
    return float(np.minimum(0.5 * beyond**2, LEFT_OUT_nats).sum())


def _filled_share(mesh: SurfaceMesh, free_points_m: Array) -> float:
    """Share of free places that lie inside a mesh by more than the contacts' noise."""
    if len(free_points_m) == 0:
        return 0.0
    inside = are_inside(free_points_m, mesh)
    if not inside.any():
        return 0.0
    deep = distances_to_mesh(free_points_m[inside], mesh) > FREE_SIGMA_m
    return float(deep.sum() / len(free_points_m))


def try_make(maker: Callable[[], FittedShape]) -> FittedShape | None:
    """What a maker makes; None if contacts do not allow this model."""
    try:
        return maker()
    except ShapeError:  # the contacts do not allow this model; the others remain
        return None
