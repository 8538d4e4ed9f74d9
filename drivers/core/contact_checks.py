"""What a whole set of grasps says about its own conventions, before anything is estimated from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array, Grasp

OPPOSING_COSINE = -0.5
"""Contacts whose normals differ by more than 120 degrees are on opposite sides of what is between them."""

ONE_SIDE_COSINE = 0.5
"""Normals that all lie within 60 degrees of their mean belong to one side of an object."""

_LEAST_PAIRS = 3


@dataclass(frozen=True)
class OpposingPairs:
    """Pairs of contacts of one grasp that face away from each other, over all grasps.

    Attributes:
        pairs: how many there are.
        inward: how many of them have normals that point at each other: into an object held between fingers.
    """

    pairs: int
    inward: int

    @property
    def point_in(self) -> bool:
        """Most of them do, which outward normals never do on an object that is held from outside."""
        return self.pairs >= _LEAST_PAIRS and 2 * self.inward > self.pairs


def opposing_pairs(grasps: Sequence[Grasp]) -> OpposingPairs:
    """Look at all pairs of contacts with opposing normals, grasp by grasp."""
    found = [_pairs(grasp.points_world_m, grasp.normals_world) for grasp in grasps]
    return OpposingPairs(sum(pairs for pairs, _ in found), sum(inward for _, inward in found))


def _pairs(points_m: Array, normals: Array) -> tuple[int, int]:
    """Number of opposing pairs, and of those whose normals point at each other."""
    one, other = np.triu_indices(len(points_m), 1)
    opposing = np.sum(normals[one] * normals[other], axis=1) < OPPOSING_COSINE
    across = points_m[one] - points_m[other]
    apart = np.sum(across * (normals[one] - normals[other]), axis=1)
    return int(opposing.sum()), int((opposing & (apart < 0)).sum())


def touched_one_side(normals: Sequence[Array]) -> bool:
    """Whether every grasp touched the object from one side only: the other sides are not known at all.

    Args:
        normals: of each grasp, shape (n, 3), any frame.
    """
    return any(len(one) for one in normals) and all(_one_sided(one) for one in normals)


def _one_sided(normals: Array) -> bool:
    if not len(normals):
        return True
    mean = normals.mean(axis=0)
    length = float(np.linalg.norm(mean))
    return length > 0 and bool(np.all(normals @ mean > ONE_SIDE_COSINE * length))
