"""Compares each contact with the field of all others, without refitting the field.

The rows of one contact given all others are Gaussian. Their covariance is the inverse of their block in the inverse
covariance of all rows; their residual is this covariance times their weights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.row_factor import RowFactor


def negative_log_densities(factor: RowFactor, weights: Array, groups: NDArray[np.intp]) -> Array:
    """Negative log densities of groups of rows, each given all other rows, up to a constant.

    Args:
        factor: of the covariance of all rows.
        weights: inverse covariance times residuals, shape (n,).
        groups: rows that belong together, shape (a, e).

    Returns:
        Shape (a,).
    """
    blocks, own = factor.inverse_blocks(groups), weights[groups]
    misfits = np.einsum("ai,ai->a", own, np.linalg.solve(blocks, own[..., None])[..., 0])
    return np.asarray(0.5 * (misfits - np.linalg.slogdet(blocks)[1]))


def inflation(factor: RowFactor, weights: Array, count: int, dimension: int) -> float:
    """How many times larger than stated the standard deviation of a surface is, at least 1.

    A stationary kernel does not model edges. This shows in the normals: the squares of their standardised leave-one-out
    residuals, ``weight^2 / inverse[i, i]``, exceed their mean for a true model, ``(d - 1) / d`` (a unit normal has no
    error along itself), by a ratio r of 2 to 3.5 on sharp shapes and of 0.9 to 1.2 on smooth ones. Variance due to the
    sensors' noise should not grow, and variance due to interpolation should grow by r; so the variance is multiplied by
    the geometric mean, ``sqrt(r)``.

    Args:
        factor, weights: as above.
        count: number of contacts; the remaining rows are their normals.
        dimension: dimension of the contacts.
    """
    squares = (weights**2 / factor.inverse_diagonal())[count:]
    ratio = float(squares.mean()) * dimension / (dimension - 1)
    return float(max(1.0, ratio) ** 0.25)
