"""The triangular factor of the covariance of all observation rows, which grows when rows are appended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from drivers.core.contacts import Array

JITTERS = (1e-10, 1e-8, 1e-6, 1e-4)
"""Additions to the diagonal, relative to its entries; the first one that makes the matrix positive definite is used."""


@dataclass(frozen=True)
class RowFactor:
    """Cholesky factor of a covariance whose rows may be in another order.

    Attributes:
        lower: of ``covariance[rows][:, rows]``, shape (n, n), column after column in memory.
        rows: shape (n,); in an extended factor rows are in the order in which they were added.
        jitter: relative addition to the diagonal.
    """

    lower: Array
    rows: NDArray[np.intp]
    jitter: float

    @classmethod
    def of(cls, matrix: Array, noise_variance: Array) -> Self | None:
        """The factor of a prior covariance with noise on its diagonal (overwritten); None if even the largest jitter
        fails.
        """
        diagonal = np.diag(matrix) + noise_variance
        for jitter in JITTERS:
            np.fill_diagonal(matrix, diagonal * (1 + jitter))
            lower, problem = lapack.dpotrf(matrix.T, lower=1, clean=1)
            if problem == 0:
                return cls(np.asarray(lower), np.arange(len(lower)), jitter)
        return None

    @property
    def log_determinant(self) -> float:
        return float(2 * np.log(np.diag(self.lower)).sum())

    def solve(self, right: Array) -> Array:
        """The inverse covariance times a vector of shape (n,)."""
        solution, _ = lapack.dpotrs(self.lower, right[self.rows], lower=1)
        restored = np.empty_like(right)
        restored[self.rows] = solution
        return restored

    def explained_variance(self, covariances: Array, single: Array | None = None) -> Array:
        """``k K^-1 k'`` for each row k of covariances with all rows, shape (q, n); shape (q,).

        Args:
            covariances: may be overwritten.
            single: :meth:`in_single_precision`, to be used in place of the factor.
        """
        columns = self._order(covariances).T
        if single is None:
            found, _ = lapack.dtrtrs(self.lower, columns, lower=1, overwrite_b=1)
        else:
            found, _ = lapack.strtrs(single, columns.astype(np.float32), lower=1, overwrite_b=1)
        return np.asarray(np.einsum("nq,nq->q", found, found, dtype=float))

    def explained_covariance(self, covariances: Array) -> Array:
        """``k K^-1 k'`` between all rows k of covariances with all rows, shape (q, n); shape (q, q)."""
        found, _ = lapack.dtrtrs(self.lower, self._order(covariances).T, lower=1)
        return np.asarray(found.T @ found)

    def in_single_precision(self) -> Array:
        """The factor in single precision, with which solving takes half the time."""
        return np.asarray(self.lower, dtype=np.float32, order="F")

    def inverse(self) -> Array:
        """Inverse of the covariance, rows in its own order."""
        lower, _ = lapack.dpotri(self.lower, lower=1)
        restored: Array = np.empty_like(lower)
        restored[np.ix_(self.rows, self.rows)] = np.tril(lower) + np.tril(lower, -1).T
        return restored

    def inverse_diagonal(self) -> Array:
        """The diagonal of :meth:`inverse`, in a third of the time."""
        inverted, _ = lapack.dtrtri(self.lower, lower=1)
        diagonal = np.empty(len(self.rows))
        diagonal[self.rows] = np.einsum("ij,ij->j", inverted, inverted)
        return diagonal

    def inverse_blocks(self, groups: NDArray[np.intp]) -> Array:
        """Blocks of :meth:`inverse`, in a third of the time or less.

        Args:
            groups: rows that belong together, shape (a, e).

        Returns:
            The inverse between the rows of each group, shape (a, e, e).
        """
        places = np.empty_like(self.rows)
        places[self.rows] = np.arange(len(places))
        columns = places[groups].ravel()
        if 3 * len(columns) > len(places):
            inverted, _ = lapack.dtrtri(self.lower, lower=1)
            half = inverted[:, columns]
        else:
            units = np.zeros((len(places), len(columns)), order="F")
            units[columns, np.arange(len(columns))] = 1.0
            half, _ = lapack.dtrtrs(self.lower, units, lower=1, overwrite_b=1)
        own = half.reshape(len(half), *groups.shape)
        return np.asarray(np.einsum("rai,raj->aij", own, own))

    def extend(self, cross: Array, corner: Array, old_rows: NDArray[np.intp], rows: NDArray[np.intp]) -> Self | None:
        """The factor with m more rows, at a cost of order ``n^2 m``; None if they make it indefinite.

        Args:
            cross: prior covariance of the new rows with the old ones, shape (m, n), the old ones in their own order.
            corner: covariance of the new rows with their noise, shape (m, m).
            old_rows: index of each old row among all rows, shape (n,).
            rows: index of each new row among all rows, shape (m,).
        """
        count = len(self.lower)
        beside, _ = lapack.dtrtrs(self.lower, self._order(cross).T, lower=1)
        diagonal = np.diag(corner) * (1 + self.jitter)
        rest = corner - beside.T @ beside
        np.fill_diagonal(rest, diagonal - np.sum(beside**2, axis=0))
        last, problem = lapack.dpotrf(rest, lower=1, clean=1)
        if problem:
            return None
        lower = np.zeros((count + len(last), count + len(last)), order="F")
        lower[:count, :count], lower[count:, :count], lower[count:, count:] = self.lower, beside.T, last
        return type(self)(lower, np.concatenate([old_rows[self.rows], rows]), self.jitter)

    def _order(self, columns: Array) -> Array:
        return columns if np.array_equal(self.rows, np.arange(len(self.rows))) else columns[:, self.rows]
