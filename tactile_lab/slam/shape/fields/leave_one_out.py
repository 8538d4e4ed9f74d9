"""What contacts say about each other: each one against the field of all others, without ever fitting that.

With the inverse covariance of all rows, the rows of one contact given all others are Gaussian with the inverse of their
own block as covariance, and are off by that times their weights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.row_factor import RowFactor


def negative_log_densities(factor: RowFactor, weights: Array, groups: NDArray[np.intp]) -> Array:
    """Of groups of rows, each given all other rows, up to a constant.

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

    A stationary kernel does not foresee edges. It shows in the normals: the squares of their standardised
    leave-one-out residuals, ``weight^2 / inverse[i, i]``, exceed their mean for a true model, ``(d - 1) / d``
    (a unit normal has no error along itself), by a ratio r of 2 to 3.5 on sharp shapes and of 0.9 to 1.2 on smooth
    ones. What comes from the sensors' noise should not grow, what comes from interpolation should grow by r;
    the variance is given the geometric mean, ``sqrt(r)``.

    Args:
        factor, weights: as above.
        count: contacts; rows beyond are their normals.
        dimension: of the contacts.
    """
    squares = (weights**2 / factor.inverse_diagonal())[count:]
    ratio = float(squares.mean()) * dimension / (dimension - 1)
    return float(max(1.0, ratio) ** 0.25)
