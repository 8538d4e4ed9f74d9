"""How an object moves that the hand lifts: with the fingertips, in all six unknowns.

The balance of :mod:`sessions.perception.carrying.friction_balance` knows objects that stand on a table: a fingertip
that rises slides along such a one, and that uses up its friction. While the hand is raised the object may rise, lean
and turn with the fingertips instead, and no table resists. What is wanted of it is how it stands when it is down again;
height and lean themselves are told too poorly by few contacts.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from sessions.perception.carrying.friction_balance import Friction, TIP_CREEP_m_s
from sessions.perception.carrying.tip_steps import HELD_BY, RAISED_m, TipSteps

_ITERATIONS = 12
_LEAST_WEIGHT = np.diag([1e-3, 1e-3, 1e-3, 1e-6, 1e-6, 1e-6])


def raised(steps: TipSteps) -> NDArray[np.bool_]:
    """Steps in which the hand is higher than where it grasped and two fingertips hold, shape (n,)."""
    heights_m = steps.world_T_palm[:, 2, 3]
    higher = np.maximum(heights_m[1:], heights_m[:-1]) > heights_m[0] + RAISED_m
    return np.asarray(higher & (steps.felt.sum(axis=1) >= HELD_BY))


def dropped_m(steps: TipSteps) -> float:
    """How high the hand was above where it grasped when the fingertips lost the object for good, m; 0 if they did not
    lose it up there.
    """
    held = np.flatnonzero(steps.felt.sum(axis=1) >= HELD_BY)
    if not len(held) or held[-1] == len(steps) - 1:
        return 0.0
    higher_m = float(steps.world_T_palm[held[-1] + 1, 2, 3] - steps.world_T_palm[0, 2, 3])
    return higher_m if higher_m > RAISED_m else 0.0


def lifted_motions(steps: TipSteps, chosen: NDArray[np.bool_], centres_m: Array, friction: Friction) -> Array:
    """Planar part of the motions of least frictional power without a table, shape (k, 3): m, m, rad.

    Args:
        steps: of the carry.
        chosen: the k steps that are meant, shape (n,).
        centres_m: reference points, shape (n, 2).
        friction: at the fingertips.
    """
    forces_N, normals, moves_m = steps.forces_N[chosen], steps.normals[chosen], steps.moves_m[chosen]
    jacobians = _jacobians(steps.points_m[chosen], centres_m[chosen], forces_N)
    across = np.einsum("nfi,nfij->nfj", normals, jacobians)
    along_m = np.einsum("nfi,nfi->nf", normals, moves_m)
    tangents, slides_m = jacobians - normals[..., None] * across[..., None, :], moves_m - normals * along_m[..., None]
    hard = friction.normal_weight * forces_N
    fixed = np.einsum("nf,nfi,nfj->nij", hard, across, across) + _LEAST_WEIGHT
    pull = np.einsum("nf,nfi->ni", hard * (along_m + friction.give_m * steps.sinking[chosen]), across)
    creep_m = TIP_CREEP_m_s * steps.step_s[chosen, None]
    motions = np.zeros((len(forces_N), 6))
    for _ in range(_ITERATIONS):
        left_m = np.linalg.norm(slides_m - np.einsum("nfij,nj->nfi", tangents, motions), axis=-1)
        grip = friction.tips * forces_N / np.maximum(left_m, creep_m)
        stiffness = fixed + np.einsum("nf,nfki,nfkj->nij", grip, tangents, tangents)
        moment = pull + np.einsum("nf,nfki,nfk->ni", grip, tangents, slides_m)
        motions = np.linalg.solve(stiffness, moment[..., None])[..., 0]
    return motions[:, [0, 1, 5]]


def _jacobians(points_m: Array, centres_m: Array, forces_N: Array) -> Array:
    """Motion of the object at each contact by its six unknowns, shape (n, 5, 3, 6)."""
    felt = (forces_N > 0.0).astype(float)
    heights_m = (felt * points_m[..., 2]).sum(axis=1) / np.maximum(felt.sum(axis=1), 1.0)
    arms = points_m - np.column_stack([centres_m, heights_m])[:, None]
    jacobians = np.zeros((*points_m.shape, 6))
    for axis in range(3):
        jacobians[..., axis, axis] = 1.0
        jacobians[..., 3 + axis] = np.cross(np.eye(3)[axis], arms)
    return jacobians
