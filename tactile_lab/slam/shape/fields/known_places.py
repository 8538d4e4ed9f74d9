"""What is known of places without contacts, as evidence for a field: a finger went through, and an object is one piece.

A field is corrected only where it is wrong: of the places where a finger was, those that it takes for the object's
inside, and, if it parts the object into pieces, the narrowest place between two of them. Each is a value of the field,
a small distance outside or inside with an uncertainty of the same size. A correction changes the field elsewhere, so
this is repeated. Kernel and evidence stay as they are.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.field_grid import FieldGrid
from tactile_lab.slam.shape.fields.gpis import Gpis

DEPTH_m = 0.002
"""How far outside or inside a told place is, and how uncertain that is."""
FREE_SIGMA_m, LARGEST_SHARE_FILLED = 0.003, 0.05
"""How deep inside a model a place that a finger went through may be by noise, and the share of such places that may be
deeper.
"""
_ROUNDS, _AT_ONCE, _LEAST_INSIDE_m = 4, 40, 0.0005
_MOST_JOINTS = 6
_RISE_m, _HIGHEST_m = 0.0005, 0.008
"""Pieces are joined at the lowest level at which they meet, up to this one."""
_MARGIN_m = 0.010
_LEAST_SHARE = 0.02
"""A piece counts if this share of the contacts is next to it."""


def outside_at(gpis: Gpis, free_m: Array) -> Gpis:
    """The field with places that are free, shape (q, d), outside of the object; normals are observed."""
    told, field = np.empty((0, free_m.shape[1])), gpis
    for _ in range(_ROUNDS):
        inside_m = -field.mean(free_m) if len(free_m) else np.empty(0)
        worst = np.argsort(-inside_m)[:_AT_ONCE]
        worst = worst[inside_m[worst] > _LEAST_INSIDE_m]
        if len(worst) == 0:
            break
        told, free_m = np.vstack([told, free_m[worst]]), np.delete(free_m, worst, axis=0)
        field = _tell(gpis, told, DEPTH_m)
    return field


def in_one_piece(gpis: Gpis, resolution_m: float) -> Gpis:
    """The field with its pieces joined where they are nearest, found on a grid; normals are observed."""
    for _ in range(_MOST_JOINTS):
        contacts_m = gpis.contacts_m
        corners_m = contacts_m.min(axis=0) - _MARGIN_m, contacts_m.max(axis=0) + _MARGIN_m
        grid = FieldGrid.tabulate(gpis, *corners_m, resolution_m)
        place_m = _narrowest_gap(grid, contacts_m)
        if place_m is None:
            break
        gpis = inside_at(gpis, place_m[None])
    return gpis


def inside_at(gpis: Gpis, places_m: Array) -> Gpis:
    """The field with places, shape (q, d), inside the object; normals are observed."""
    return _tell(gpis, places_m, -DEPTH_m)


def wall_at(gpis: Gpis, places_m: Array, outward: Array, sigma_m: Array) -> Gpis:
    """The field with a wall through places, shape (q, d): inside on one side of it, outside on the other.

    Args:
        gpis: normals are observed.
        places_m, outward: on the wall, and unit vectors across it, shape (q, d) each.
        sigma_m: how uncertain the wall's place is, shape (q,).
    """
    field = _tell(gpis, places_m - DEPTH_m * outward, -DEPTH_m, np.maximum(sigma_m, DEPTH_m))
    return _tell(field, places_m + DEPTH_m * outward, DEPTH_m, np.maximum(sigma_m, DEPTH_m))


def _tell(gpis: Gpis, places_m: Array, value_m: float, sigma_m: Array | float = DEPTH_m) -> Gpis:
    """The field with further observed values."""
    seen, count = gpis.observations, len(places_m)
    observations = replace(
        seen,
        points_m=np.vstack([seen.points_m, places_m]),
        values_m=np.append(seen.values_m, np.full(count, value_m)),
        value_sigma_m=np.append(seen.value_sigma_m, np.broadcast_to(sigma_m, count)),
    )
    return Gpis(gpis.contacts_m, gpis.normals, gpis.settings, observations, gpis.kernel, gpis.prior, gpis.noise_scale)


def _narrowest_gap(grid: FieldGrid, contacts_m: Array) -> Array | None:
    """Between the piece with most contacts and the one that it meets first when the level rises; None if there is one
    piece, or if they do not meet.
    """
    labels, _ = ndimage.label(grid.values_m < 0)
    inside = np.argwhere(labels)
    if len(inside) == 0:
        return None
    _, nearest = cKDTree(inside).query((contacts_m - grid.lower_m) / grid.spacing_m)
    votes = np.bincount(labels[tuple(inside[nearest].T)])
    pieces = np.flatnonzero(votes >= max(2, _LEAST_SHARE * len(contacts_m)))
    largest = votes.argmax()
    for level_m in np.arange(_RISE_m, _HIGHEST_m, _RISE_m) if len(pieces) > 1 else ():
        joined, _ = ndimage.label(grid.values_m < level_m)
        home = joined[labels == largest][0]
        met = [piece for piece in pieces if piece != largest and joined[labels == piece][0] == home]
        if met:
            away = np.maximum(*(ndimage.distance_transform_edt(labels != piece) for piece in (largest, met[0])))
            away[joined != home] = np.inf
            node = np.unravel_index(away.argmin(), away.shape)
            return np.asarray(grid.lower_m + grid.spacing_m * np.array(node))
    return None
