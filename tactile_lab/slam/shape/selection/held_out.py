"""Cross-validation of surface models: how well they predict contacts to which they were not fitted.

Many small faces can follow a rounded edge and fit their own contacts well, but predict held-out contacts poorly. Each
quarter of the contacts in turn is predicted from the rest.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import trimesh

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.model import FittedShape
from tactile_lab.slam.shape.solids.planes import WeightedContacts
from tactile_lab.slam.shape.solids.polyhedron import contacts_of
from tactile_lab.slam.shape.surfaces.surface import Indices, SurfaceMesh

_WORST_nats = 30.0
"""Largest cost of a held-out contact: more than that of an outlier, or a whole rounded edge would count as outliers."""
_PARTS = 4
_NOTHING_nats = -1e4
"""Of a solid that encloses nothing, beside another one."""
_SETTLED_nats = 45.0
"""With this much evidence for or against, the remaining quarters are skipped."""


Fit: TypeAlias = Callable[[Gpis], FittedShape]
"""Makes a solid from the field of some of the contacts."""


def predicts_better(fit: Fit, gpis: Gpis, resolution_m: float, floor_m: float | None) -> bool:
    """Whether a sharp solid predicts the contacts of a field better than the field does.

    Args:
        fit: makes the solid.
        gpis: the field, its kernel at a maximum of the marginal likelihood.
        resolution_m: resolution of the solid's surface; its faces do not depend on it.
        floor_m: height of the table, if there is one.
    """

    def advantage(held: Indices, rest: Indices) -> float:
        return _predicted(fit, gpis, held, rest, resolution_m, floor_m) - gpis.log_density_given_others(held)

    return _sum_over_parts(advantage, len(gpis.contacts_m)) > 0


def predicts_better_than(fit: Fit, other: Fit, gpis: Gpis, resolution_m: float, floor_m: float | None) -> bool:
    """Whether a solid predicts contacts better than another solid; arguments as of :func:`predicts_better`."""

    def advantage(held: Indices, rest: Indices) -> float:
        given = gpis, held, rest, resolution_m, floor_m
        return max(_predicted(fit, *given), _NOTHING_nats) - max(_predicted(other, *given), _NOTHING_nats)

    return _sum_over_parts(advantage, len(gpis.contacts_m)) > 0


def _sum_over_parts(advantage: Callable[[Indices, Indices], float], count: int) -> float:
    """The sum for each quarter held out and its rest, as far as it is not settled before."""
    total = 0.0
    for part in range(_PARTS):
        held = np.arange(part, count, _PARTS)
        total += advantage(held, np.setdiff1d(np.arange(count), held))
        if abs(total) > _SETTLED_nats:
            break
    return total


def _predicted(fit: Fit, gpis: Gpis, held: Indices, rest: Indices, resolution_m: float, floor_m: float | None) -> float:
    """Log density of held-out contacts on the solid of the rest; minus infinity if that does not enclose anything."""
    try:
        mesh = fit(gpis.of_some(rest)).mesh(resolution_m, floor_m)
    except ShapeError:
        return -np.inf
    return _log_density(contacts_of(gpis), held, mesh)


def _log_density(contacts: WeightedContacts, held: Indices, mesh: SurfaceMesh) -> float:
    """Log density of contacts, each on the triangle of a surface that fits its position and normal best; limited by
    :data:`_WORST_nats`.
    """
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
    misfits = [_misfit(contacts, int(contact), corners, normals) for contact in held]
    weights, turns = contacts.point_weights[held], contacts.normal_weights[held]
    peaks = 0.5 * np.log(weights) + 1.5 * np.log(turns) - 2 * np.log(2 * np.pi)
    return float(np.sum(peaks - np.minimum(misfits, _WORST_nats)))


def _misfit(contacts: WeightedContacts, contact: int, corners: Array, normals: Array) -> float:
    point_m = np.broadcast_to(contacts.points_m[contact], (len(corners), 3))
    nearest_m = trimesh.triangles.closest_point(corners, point_m)  # type: ignore[no-untyped-call]
    away_m = np.asarray(nearest_m) - point_m
    turned = normals - contacts.normals[contact]
    weight, turn = contacts.point_weights[contact], contacts.normal_weights[contact]
    return float(0.5 * np.min(weight * np.sum(away_m**2, axis=1) + turn * np.sum(turned**2, axis=1)))
