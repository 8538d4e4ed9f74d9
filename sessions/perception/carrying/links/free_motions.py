"""How the motors move fingers that touch nothing, learned from closings.

A finger that closes through free space loads a motor by friction, damping and inertia alone:

    counts = a + b v + c tanh(v / v0) + d dv/dt

with the speed v of its joint. The four are fitted for each motor, robustly, to the newest closings as far as the
finger's tip touches nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array

_EVERY = 2
"""Sample of which the free motions are fitted; the palm reads half of the motors in a cycle."""
_STICTION_rad_s = 0.05
_USUAL_SAMPLES = 30.0
"""Motors of the same joint of other fingers count like so many samples, half of a closing: a link that pushes in one of
the first closings of a session, from its beginning, would else be taken for the finger's free motion.
"""
_ROUGHER = 2.0
"""A motor scatters no more than so many times as much as those of other fingers do."""
_LEAST_COUNTS, _SIGMAS = 14.0, 4.0
"""Of a push: more than this, and more than so many robust standard deviations of the free motions."""
_ANY_COUNTS = 1e6
"""More than any gauge shows."""
_FIT_SAMPLES, _FITS = 20, 6
_MEDIAN_TO_SIGMA = 1.48


@dataclass(frozen=True)
class Closing:
    """What the motors did in one closing.

    Attributes:
        terms: of the free motion, shape (n, 20, 4).
        counts: towards larger angles, shape (n, 20).
        usable: where the finger's tip touches nothing and the joint is not near an end, shape (n, 20).
    """

    terms: Array
    counts: Array
    usable: NDArray[np.bool_]


def terms_of(speeds: Array, step_s: float) -> Array:
    """The terms of the free motion, shape (n, 20, 4), of the joints' speeds, shape (n, 20)."""
    changes = np.gradient(speeds, step_s, axis=0)
    return np.stack([np.ones_like(speeds), speeds, np.tanh(speeds / _STICTION_rad_s), changes], axis=-1)


@dataclass(frozen=True)
class FreeMotions:
    """How the motors move free fingers.

    Attributes:
        coefficients: of the terms, shape (20, 4).
        limits: counts beyond them that are a push, shape (20,); infinite for a motor that too little is known of.
    """

    coefficients: Array
    limits: Array

    @classmethod
    def of(cls, closings: Sequence[Closing], alike: Array) -> FreeMotions:
        """Fitted to closings.

        Args:
            closings: the newest.
            alike: 1 for each pair of motors of the same joint, shape (20, 20).
        """
        moves = _Moves.of(closings)
        numbers = moves.usable.sum(axis=1)
        usual = moves.fitted(_nothing_known(moves), alike)
        share = _USUAL_SAMPLES / np.maximum(alike @ numbers, _USUAL_SAMPLES)
        known = replace(usual, squares=share[:, None, None] * usual.squares, scatter=_ROUGHER * usual.scatter)
        own = moves.fitted(known, np.eye(len(alike)))
        limits = np.maximum(_LEAST_COUNTS, _SIGMAS * np.minimum(own.scatter, known.scatter))
        return cls(own.coefficients, np.where(numbers >= _FIT_SAMPLES / _EVERY, limits, np.inf))

    def pushes(self, closing: Closing) -> NDArray[np.bool_]:
        """Where a motor that is usable does more than move its finger, shape (n, 20)."""
        free = np.einsum("nmk,mk->nm", closing.terms, self.coefficients)
        return np.asarray((np.abs(closing.counts - free) > self.limits) & closing.usable)


@dataclass(frozen=True)
class _Fit:
    """What is known of the motors' motions.

    Attributes:
        coefficients: of the terms, shape (20, 4).
        squares: weighted products of the terms, summed over the samples that tell of them, shape (20, 4, 4).
        scatter: robust standard deviations of the counts, shape (20,); infinite if nothing is known.
    """

    coefficients: Array
    squares: Array
    scatter: Array


def _nothing_known(moves: _Moves) -> _Fit:
    motors, _, terms = moves.terms.shape
    return _Fit(np.zeros((motors, terms)), np.tile(1e-3 * np.eye(terms), (motors, 1, 1)), np.full(motors, np.inf))


@dataclass(frozen=True)
class _Moves:
    """Samples of several closings, by motor.

    Attributes:
        terms: of the free motion, shape (20, n, 4).
        counts: shape (20, n).
        usable: shape (20, n).
    """

    terms: Array
    counts: Array
    usable: NDArray[np.bool_]

    @classmethod
    def of(cls, closings: Sequence[Closing]) -> _Moves:
        terms = np.concatenate([each.terms[::_EVERY] for each in closings]).transpose(1, 0, 2)
        counts = np.concatenate([each.counts[::_EVERY] for each in closings]).T
        return cls(terms, counts, np.concatenate([each.usable[::_EVERY] for each in closings]).T)

    def fitted(self, known: _Fit, together: Array) -> _Fit:
        """Fitted by reweighted least squares, around what is known.

        Args:
            known: before; its scatter is the largest. Where that is infinite all samples count alike at first.
            together: 1 for each pair of motors whose samples count for both, shape (20, 20).
        """
        fit = known
        known_right = (known.squares @ known.coefficients[..., None])[..., 0]
        for _ in range(_FITS):
            width = 2 * np.clip(np.minimum(fit.scatter, known.scatter), _LEAST_COUNTS / 7, _ANY_COUNTS)
            weights = 1 / (1 + (self._off(fit.coefficients) / width[:, None]) ** 2)
            weighted = self.terms * weights[..., None]
            squares = np.tensordot(together, weighted.transpose(0, 2, 1) @ self.terms, 1) + known.squares
            right = together @ np.einsum("mnk,mn->mk", weighted, self.counts) + known_right
            coefficients = np.linalg.solve(squares, right[..., None])[..., 0]
            fit = _Fit(coefficients, squares, self._scatter(coefficients, together))
        return fit

    def _off(self, coefficients: Array) -> Array:
        """By how much the counts are off, shape (20, n); infinite where they say nothing."""
        off = np.abs(self.counts - (self.terms @ coefficients[..., None])[..., 0])
        return np.where(self.usable, off, np.inf)

    def _scatter(self, coefficients: Array, together: Array) -> Array:
        """Robust standard deviation of each motor's counts; of motors that count together the (lower) middle one."""
        ordered, middle = np.sort(self._off(coefficients), axis=1), self.usable.sum(axis=1) // 2
        own = ordered[range(len(ordered)), np.minimum(middle, ordered.shape[1] - 1)]
        alike = np.sort(np.where(together > 0, own, np.inf), axis=1)
        return _MEDIAN_TO_SIGMA * alike[range(len(alike)), (np.count_nonzero(together, axis=1) - 1) // 2]
