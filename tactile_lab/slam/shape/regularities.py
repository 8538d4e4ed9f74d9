"""Regularities of faces.

Manufactured objects have right angles and parallel, vertical and horizontal faces. A regularity is accepted if it is
the more likely explanation: if its misfit costs less than an arbitrary angle within a quarter turn (Bayes factor with
equal priors). The directions of all faces form one Gaussian state. A regularity is an exact measurement of this state,
with the usual gate, so that information about one wall improves all walls related to it. After each regularity the
state is conditioned again on all of them, linearised where they hold exactly. Otherwise a regularity that follows from
others would seem informative, and would fix what is still undetermined.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array

Kind: TypeAlias = Literal["level", "upright", "parallel", "right angle"]

_LARGEST_TURN_rad = np.deg2rad(15.0)
_IMPLIED = 1e-6
"""Remaining share of a variance, due to rounding, if a regularity follows from others."""
_ANY_ANGLE_rad = np.pi / 2
_MOST_STEPS, _EXACT_rad = 8, 1e-9


class Stated(NamedTuple):
    """``gap = rows . directions`` is to vanish, where ``directions`` are all normals one after the other; shapes (r,)
    and (r, s d).
    """

    gap: Array
    rows: Array


class Regularity(NamedTuple):
    """A relation between two faces, or between a horizontal or vertical face and the vertical axis.

    Attributes:
        kind: of regularity.
        face, other: numbers of the faces; the same number twice for a relation to the vertical.
    """

    kind: Kind
    face: int
    other: int

    def state(self, normals: Array) -> Stated:
        """The linearised condition at nearly regular unit normals of shape (s, d)."""
        count, dimension = normals.shape
        rows = np.zeros((dimension - 1, count, dimension))
        one, other = normals[self.face], normals[self.other]
        if self.kind == "upright":
            rows[0, self.face, 2] = 1.0
            return Stated(one[2:], rows[:1].reshape(1, -1))
        if self.kind == "level":
            rows[0, self.face, 0] = rows[1, self.face, 1] = 1.0
            return Stated(one[:2], rows.reshape(2, -1))
        if self.kind == "right angle":
            rows[0, self.face], rows[0, self.other] = other, one
            return Stated(np.array([one @ other]), rows[:1].reshape(1, -1))
        across = np.linalg.svd(one[None])[2][1:]
        rows[:, self.other], rows[:, self.face] = across, -np.sign(one @ other) * across
        return Stated(across @ other, rows.reshape(dimension - 1, -1))


@dataclass(frozen=True)
class RegularNormals:
    """Normals that satisfy regularities.

    Attributes:
        normals: shape (s, d).
        covariance: of all their components, shape (s d, s d), square radians.
        regularities: the accepted regularities.
        saved: number of parameters that they make unnecessary.
    """

    normals: Array
    covariance: Array
    regularities: tuple[Regularity, ...]
    saved: int


def offsets_of_faces(points_m: Array, sigma_m: Array, labels: NDArray[np.int64], normals: Array) -> Array:
    """Offsets of faces with given normals (s, d) from their contacts: means weighted by their sigmas, shape (s,)."""
    weights = sigma_m**-2.0
    heights_m = np.einsum("nd,nd->n", normals[labels], points_m)
    totals = np.bincount(labels, weights, len(normals))
    return np.asarray(np.bincount(labels, weights * heights_m, len(normals)) / totals)


def regular_normals(normals: Array, covariance: Array, *, upright: bool) -> RegularNormals:
    """Rotate normals until they are as regular as their uncertainty allows.

    Args:
        normals: unit normals of faces, shape (s, d).
        covariance: of all their components, shape (s d, s d), square radians.
        upright: whether the third axis is vertical, so that horizontal and vertical faces are likely.
    """
    turned, known, taken = normals, covariance, tuple[Regularity, ...]()
    for regularity in _promising_first(normals, covariance, upright=upright):
        stated = regularity.state(turned)
        if np.abs(stated.gap).max() > np.sin(_LARGEST_TURN_rad):
            continue
        if _advantage(stated, known, covariance) > 0:
            taken = (*taken, regularity)
            turned, known = _condition(normals, covariance, taken, turned)
    return RegularNormals(turned, known, taken, _rank(taken, turned))


def _rank(taken: tuple[Regularity, ...], normals: Array) -> int:
    """Number of angles that the regularities fix; an early one may follow from later ones."""
    rows = [np.empty((0, normals.size)), *(regularity.state(normals).rows for regularity in taken)]
    return int(np.linalg.matrix_rank(np.vstack(rows), tol=_IMPLIED))


def _promising_first(normals: Array, covariance: Array, *, upright: bool) -> list[Regularity]:
    candidates = list(_candidates(len(normals), upright=upright))
    stated = [candidate.state(normals) for candidate in candidates]
    order = np.argsort([-_advantage(each, covariance, covariance) / len(each.gap) for each in stated])
    return [candidates[i] for i in order]


def _candidates(count: int, *, upright: bool) -> Iterator[Regularity]:
    for face in range(count):
        if upright:
            yield Regularity("level", face, face)
            yield Regularity("upright", face, face)
        for other in range(face):
            yield Regularity("parallel", face, other)
            yield Regularity("right angle", face, other)


def _advantage(stated: Stated, covariance: Array, before: Array) -> float:
    """Twice the log Bayes factor of a regularity against an arbitrary angle; 0 if it follows from accepted ones.

    Args:
        stated: the regularity.
        covariance: of the normals, given the regularities so far.
        before: the covariance without any regularity.
    """
    variances, axes = np.linalg.eigh(stated.rows @ covariance @ stated.rows.T)
    still_open = variances > _IMPLIED * np.trace(stated.rows @ before @ stated.rows.T)
    variances, gaps = variances[still_open], axes.T[still_open] @ stated.gap
    return float(np.sum(2 * np.log(_ANY_ANGLE_rad) - np.log(2 * np.pi * variances) - gaps**2 / variances))


def _condition(normals: Array, covariance: Array, taken: tuple[Regularity, ...], start: Array) -> tuple[Array, Array]:
    """The most likely normals that satisfy all regularities, shape (s, d), and their covariance (Gauss-Newton).

    Args:
        normals, covariance: the state without regularities.
        taken: the accepted regularities.
        start: normals near the solution, shape (s, d).
    """
    found = start
    for _ in range(_MOST_STEPS):
        stated = [regularity.state(found) for regularity in taken]
        gap, rows = np.concatenate([each.gap for each in stated]), np.vstack([each.rows for each in stated])
        spread = rows @ covariance
        gain = np.linalg.pinv(spread @ rows.T, rcond=_IMPLIED, hermitian=True) @ spread
        if np.abs(gap).max() < _EXACT_rad:
            break
        moved = normals + ((rows @ (found - normals).ravel() - gap) @ gain).reshape(normals.shape)
        found = moved / np.linalg.norm(moved, axis=1, keepdims=True)
    return found, covariance - spread.T @ gain
