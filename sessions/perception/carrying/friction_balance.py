"""The motion of least frictional power: how an object moves between fingertips that drag it over a table.

A quasi-static object moves such that friction uses up as little power as possible (Peshkin and Sanderson 1989). For
each step the unknown is the object's small motion on the table, y = (dx, dy, da) about a reference point. With s_i the
motion of fingertip i's material relative to the object at the contact, n_i its normal and N_i its normal force, y
minimises

    sum_i w N_i (n_i . s_i + g_i)^2  +  sum_i mu N_i H(|s_i - (n_i . s_i) n_i|)  +  F H(sqrt(dx^2 + dy^2 + c^2 da^2))

Fingertips neither enter nor leave the object, but for the give g_i of their skin when the force changes; those inside
their friction cones stick and the others slide where it costs least, without anybody deciding which; the table resists
(an ellipsoidal limit surface, Howe and Cutkosky 1996). H is the absolute value, quadratic below a creep. It is convex;
reweighted least squares solve all steps at once. Tangential forces are not used: normals, normal forces and the
fingertips' motion suffice. Without a contact the object stays where it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from drivers.core.contacts import Array
from sessions.perception.carrying.tip_steps import TipSteps

TIP_CREEP_m_s, TABLE_CREEP_m_s = 0.003, 0.005
"""Slower sliding than this is the give of soft skin, or the joint angles' noise. A larger one of the fingertips lets a
round object turn in a hand that holds it: its normals all go through the axis, and only sticking turns it.
"""
_LEAST_WEIGHT = np.diag([1e-3, 1e-3, 1e-6])
"""Keeps a step determined in which nothing holds the object, not even the table."""
_OF_SQUARES = np.array([1.0] * 9 + [-2.0] * 3)

_FOOT_SHARE = 0.6
"""Radius at which the table's friction acts against a turn, as a share of the foot's: 2/3 for a disc that presses
evenly, less where the middle carries more.
"""


@dataclass(frozen=True)
class Friction:
    """What the balance assumes.

    Attributes:
        tips: coefficient of friction at the fingertips.
        table_N: force of friction of the table on the object: its weight times the coefficient.
        half_width_m: radius of the object's foot.
        normal_weight: w, 1/m; how hard the normals are.
        give_m: how much deeper a fingertip sinks in when its force grows e-fold; its joints move by so much, and the
            object does not. Links that bend under the force do the same.
    """

    tips: float = 0.6
    table_N: float = 1.0
    half_width_m: float = 0.05
    normal_weight: float = 5e5
    give_m: float = 0.0003

    @property
    def foot_m(self) -> float:
        """Radius at which the table's friction acts against a turn."""
        return _FOOT_SHARE * self.half_width_m


@dataclass(frozen=True)
class MeasuredFriction:
    """What is known of an object's friction; nothing to begin with.

    Attributes:
        table_N, table_sigma_N: force of friction of the table, and its standard deviation; None if it was not dragged.
        tips_at_least: what the fingertips' coefficient of friction is at least.
        weight_N: of the object; NaN if it was not lifted.
    """

    table_N: float | None = None
    table_sigma_N: float = 0.0
    tips_at_least: float = 0.0
    weight_N: float = float("nan")

    def known(self, usual: Friction) -> Friction:
        """The usual assumptions, with what was measured in their place."""
        table_N = usual.table_N if self.table_N is None else self.table_N
        return replace(usual, table_N=table_N, tips=max(usual.tips, self.tips_at_least))

    @property
    def least_table_N(self) -> float:
        """The least friction of the table that cannot be excluded."""
        return 0.0 if self.table_N is None else max(0.0, self.table_N - 2 * self.table_sigma_N)

    @property
    def most_table_N(self) -> float | None:
        """The most, two standard deviations above what was measured; None if nothing was."""
        return None if self.table_N is None else self.table_N + 2 * self.table_sigma_N


@dataclass(frozen=True)
class Balance:
    """The linear and quadratic terms of n steps, from which every choice of friction is solved.

    Attributes:
        centres_m: reference points, shape (n, 2).
        forces_N: normal forces, shape (n, 5).
        tangential, tangential_squared: square of a tangential relative motion as y' A y - 2 b' y + c: the elements of A
            and of b, shape (n, 5, 12), and c, shape (n, 5).
        entering, entering_gradient: of the motions along the normals, summed, shapes (n, 3, 3) and (n, 3).
        giving_gradient: what the latter grows by for each metre of give, shape (n, 3).
        step_s: shape (n,).
    """

    centres_m: Array
    forces_N: Array
    tangential: Array
    tangential_squared: Array
    entering: Array
    entering_gradient: Array
    giving_gradient: Array
    step_s: Array

    @classmethod
    def of(cls, steps: TipSteps) -> Balance:
        """Of the steps of a carry."""
        forces_N, moves_m, normals = steps.forces_N, steps.moves_m, steps.normals
        centres_m = _centres_m(steps)
        arms = steps.points_m[..., :2] - centres_m[:, None]
        jacobians = np.zeros((*forces_N.shape, 3, 3))
        jacobians[..., 0, 0] = jacobians[..., 1, 1] = 1.0
        jacobians[..., 0, 2], jacobians[..., 1, 2] = -arms[..., 1], arms[..., 0]
        across = np.einsum("nfi,nfij->nfj", normals, jacobians)
        along = np.einsum("nfi,nfi->nf", normals, moves_m)
        sticking = np.einsum("nfki,nfkj->nfij", jacobians, jacobians) - across[..., :, None] * across[..., None, :]
        gradient = np.einsum("nfki,nfk->nfi", jacobians, moves_m) - across * along[..., None]
        squared = np.einsum("nfi,nfi->nf", moves_m, moves_m) - along**2
        return cls(
            centres_m=centres_m,
            forces_N=forces_N,
            tangential=np.concatenate([sticking.reshape(*forces_N.shape, 9), gradient], axis=-1),
            tangential_squared=squared,
            entering=np.einsum("nf,nfi,nfj->nij", forces_N, across, across),
            entering_gradient=np.einsum("nf,nfi,nf->ni", forces_N, across, along),
            giving_gradient=np.einsum("nf,nfi,nf->ni", forces_N, across, steps.sinking),
            step_s=steps.step_s,
        )

    def solve(self, choices: Sequence[Friction], iterations: int, start: Array | None = None) -> Array:
        """The motions of least power for several assumptions, shape (choices, n, 3): m, m, rad.

        Args:
            choices: what is assumed.
            iterations: of reweighted least squares.
            start: motions to begin with, shape (n, 3); by default an object at rest.
        """
        tips, table_N, foot_m, hardness, give_m = (
            np.array([getattr(choice, name) for choice in choices])
            for name in ("tips", "table_N", "foot_m", "normal_weight", "give_m")
        )
        terms = np.zeros((len(self.centres_m), len(choices), 12))
        motions = terms[..., 9:]
        if start is not None:
            motions[:] = start[:, None]
        fixed = np.empty_like(terms)
        fixed[..., :9] = hardness[:, None] * self.entering.reshape(-1, 1, 9) + _LEAST_WEIGHT.ravel()
        given = give_m[:, None] * self.giving_gradient[:, None]
        fixed[..., 9:] = hardness[:, None] * (self.entering_gradient[:, None] + given)
        strength_N, foot_squared = tips[:, None] * self.forces_N[:, None], foot_m**2
        creep_m, rest_m = (speed * self.step_s[:, None] for speed in (TIP_CREEP_m_s, TABLE_CREEP_m_s))
        for _ in range(iterations):
            grip = strength_N / np.maximum(self._sliding_m(terms), creep_m[..., None])
            dragged_m = np.sqrt(terms[..., 0] + terms[..., 4] + foot_squared * terms[..., 8])
            drag = table_N / np.maximum(dragged_m, rest_m)
            system = grip @ self.tangential
            system += fixed
            system[..., 0] += drag
            system[..., 4] += drag
            system[..., 8] += foot_squared * drag
            _solve(system, motions)
        return np.asarray(motions.swapaxes(0, 1))

    def sliding_m(self, motions: Array) -> Array:
        """Tangential motion of each fingertip relative to the object, shape (n, 5), for motions (n, 3)."""
        return self._sliding_m(np.concatenate([np.zeros((len(motions), 9)), motions], axis=-1)[:, None])[:, 0]

    @cached_property
    def _of_squares(self) -> Array:
        return np.asarray(self.tangential.swapaxes(1, 2) * _OF_SQUARES[:, None])

    def _sliding_m(self, terms: Array) -> Array:
        """The same for several motions of each step: shape (n, k, 5).

        Args:
            terms: room for the products of a motion's elements, and the motion, shape (n, k, 12).
        """
        motions = terms[..., 9:]
        products = terms[..., :9].reshape(*terms.shape[:-1], 3, 3)
        np.multiply(motions[..., :, None], motions[..., None, :], out=products)
        squares = terms @ self._of_squares
        squares += self.tangential_squared[:, None]
        return np.asarray(np.sqrt(np.maximum(squares, 0.0, out=squares), out=squares))


def _solve(systems: Array, into: Array) -> None:
    """Solves symmetric positive definite systems of three: matrix and right side in (..., 12), solution (..., 3).

    Written out (L D L'), which takes a tenth of the time of a call of LAPACK for each.
    """
    a, b, c, _, d, e, _, _, f, x, y, z = systems.transpose(2, 0, 1)
    b_a, c_a = b / a, c / a
    d_left, e_left = d - b_a * b, e - c_a * b
    e_d = e_left / d_left
    y_left = y - b_a * x
    z = (z - c_a * x - e_d * y_left) / (f - c_a * c - e_d * e_left)
    y = y_left / d_left - e_d * z
    into[..., 0], into[..., 1], into[..., 2] = x / a - b_a * y - c_a * z, y, z


def _centres_m(steps: TipSteps) -> Array:
    """Middle of the contacts of each step, shape (n, 2); where there are none, of all of them."""
    felt = steps.felt.astype(float)
    count = felt.sum(axis=1)
    everywhere = np.einsum("nf,nfi->i", felt, steps.points_m[..., :2]) / max(float(felt.sum()), 1.0)
    middles = np.einsum("nf,nfi->ni", felt, steps.points_m[..., :2]) / np.maximum(count, 1.0)[:, None]
    return np.asarray(np.where(count[:, None] > 0, middles, everywhere))


def compose_steps(motions: Array, centres_m: Array) -> Array:
    """The motion of all steps together, in the world.

    Args:
        motions: (dx, dy, da) of the point of the object whose path has its middle in the centre; shape (..., n, 3).
        centres_m: shape (n, 2).

    Returns:
        Homogeneous planar matrices, shape (..., 3, 3).
    """
    cosine, sine = np.cos(motions[..., 2]), np.sin(motions[..., 2])
    before = centres_m - motions[..., :2] / 2
    matrices = np.zeros((*motions.shape[:-1], 3, 3))
    matrices[..., 0, 0] = matrices[..., 1, 1] = cosine
    matrices[..., 0, 1], matrices[..., 1, 0], matrices[..., 2, 2] = -sine, sine, 1.0
    matrices[..., :2, 2] = before + motions[..., :2]
    matrices[..., 0, 2] -= cosine * before[..., 0] - sine * before[..., 1]
    matrices[..., 1, 2] -= sine * before[..., 0] + cosine * before[..., 1]
    while matrices.shape[-3] > 1:  # pairs, pairs of pairs, ...: a few array products instead of one for each step
        if matrices.shape[-3] % 2:
            rest = np.broadcast_to(np.eye(3), (*matrices.shape[:-3], 1, 3, 3))
            matrices = np.concatenate([matrices, rest], axis=-3)
        matrices = matrices[..., 1::2, :, :] @ matrices[..., 0::2, :, :]
    return np.asarray(matrices[..., 0, :, :])
