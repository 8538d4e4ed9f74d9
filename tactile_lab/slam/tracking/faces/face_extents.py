"""Extents of the faces of an outline: contacts lie between the corners, not only on the lines of their faces.

A grasp that touches only parallel faces may slide along them, and only the motion model would hold it otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array

LEAST_TURN = 0.3
"""Sine of the least angle between two faces that end at each other, 17 degrees; flatter ones may be a single face."""

FARTHEST_SIGMAS = 3.0
"""If contacts lie farther beyond a corner than this, the corner is probably wrong."""


@dataclass(frozen=True)
class Overhang:
    """How far contacts lie beyond the ends of their faces, linearised.

    Attributes:
        beyond_m: zero for contacts between the corners, shape (n,).
        ways: directions in which the contacts leave their faces, zero for those between the corners, shape (n, 2).
        by_offsets: derivatives of ``beyond_m`` by the offsets of all faces, shape (n, s).
    """

    beyond_m: Array
    ways: Array
    by_offsets: Array


def overhang(points_m: Array, labels: NDArray[np.int64], normals: Array, offsets_m: Array) -> Overhang:
    """Contacts against the corners of their faces.

    Args:
        points_m: contacts, shape (n, 2).
        labels: their faces, shape (n,).
        normals, offsets_m: of the faces, which follow each other counter-clockwise, shape (s, 2) and (s,).
    """
    count, contact = len(offsets_m), np.arange(len(points_m))
    along = np.column_stack([-normals[:, 1], normals[:, 0]])
    found = Overhang(np.zeros(len(points_m)), np.zeros_like(points_m), np.zeros((len(points_m), count)))
    for way in (1, -1):
        neighbour = (np.arange(count) + way) % count
        turn = np.einsum("sd,sd->s", along, normals[neighbour])
        steep = np.abs(turn) > LEAST_TURN
        turn = np.where(steep, turn, 1.0)
        across = np.einsum("sd,sd->s", normals, normals[neighbour])
        ends_m = (offsets_m[neighbour] - offsets_m * across) / turn
        beyond = way * (np.einsum("nd,nd->n", along[labels], points_m) - ends_m[labels])
        over = steep[labels] & (beyond > found.beyond_m)
        found.beyond_m[over], found.ways[over] = beyond[over], way * along[labels[over]]
        found.by_offsets[over] = 0.0
        found.by_offsets[contact[over], labels[over]] = (way * across / turn)[labels[over]]
        found.by_offsets[contact[over], neighbour[labels[over]]] = (-way / turn)[labels[over]]
    return found


def between_ends(
    points_m: Array, labels: NDArray[np.int64], normals: Array, offsets_m: Array, sigma_m: Array
) -> NDArray[np.bool_]:
    """Contacts between the ends of their faces, but for noise of standard deviation ``sigma_m``, shape (n,)."""
    return np.asarray(overhang(points_m, labels, normals, offsets_m).beyond_m < FARTHEST_SIGMAS * sigma_m)
