"""Checks the conventions of a set of grasps before anything is estimated from it."""

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
        pairs: their number.
        inward: number with normals that point at each other: into an object held between fingers.
    """

    pairs: int
    inward: int

    @property
    def point_in(self) -> bool:
        """Whether most of them do; outward normals of an object held from outside never do."""
        return self.pairs >= _LEAST_PAIRS and 2 * self.inward > self.pairs


def opposing_pairs(grasps: Sequence[Grasp]) -> OpposingPairs:
    """Count all pairs of contacts with opposing normals, grasp by grasp."""
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
    """Whether every grasp touched the object from one side only: the other sides are unknown.

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
