"""What a model of the surface foretells of contacts that it was not fitted to.

Many small faces follow a rounded edge, and the contacts that they were fitted to say that they do so well; contacts
that were held out say otherwise. A quarter of the contacts is foretold by the rest, each quarter in turn.
"""

from __future__ import annotations

from collections.abc import Callable

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
"""What a contact held out costs at most: more than an outlier does, or a whole rounded edge would count as outliers."""
_PARTS = 4
_SETTLED_nats = 45.0
"""With so much for or against, further quarters are not asked."""


def foretells_better(
    fit: Callable[[Gpis], FittedShape], gpis: Gpis, resolution_m: float, floor_m: float | None
) -> bool:
    """Whether a sharp solid foretells the contacts of a field better than the field does.

    Args:
        fit: makes the solid from the field of some of the contacts.
        gpis: the field, its kernel at a maximum of the marginal likelihood.
        resolution_m: of the solid's surface; its faces do not depend on it.
        floor_m: height of the table, if there is one.
    """
    contacts = contacts_of(gpis)
    advantage = 0.0
    for part in range(_PARTS):
        held = np.arange(part, len(contacts), _PARTS)
        rest = np.setdiff1d(np.arange(len(contacts)), held)
        try:
            mesh = fit(gpis.of_some(rest)).mesh(resolution_m, floor_m)
        except ShapeError:  # the rest does not enclose anything
            return False
        advantage += _log_density(contacts, held, mesh) - gpis.log_density_given_others(held)
        if abs(advantage) > _SETTLED_nats:
            break
    return advantage > 0


def _log_density(contacts: WeightedContacts, held: Indices, mesh: SurfaceMesh) -> float:
    """Of contacts, each on that triangle of a surface which place and normal fit best; at worst :data:`_WORST_nats`."""
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
