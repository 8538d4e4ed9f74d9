"""The inner loops of the trajectory's likelihood, compiled.

Rows and columns of the matrices are ordered as in :func:`tactile_lab.slam.shape.fields.kernels.covariance`: all values,
then the gradients' first components, then their second ones, and so on. Differences are ``d = p_a - p_b``.
"""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.compiled import compile_when_called


@compile_when_called
def assemble(points: Array, value: Array, first: Array, second: Array, noise_variance: Array, jitter: float) -> Array:
    """Covariance of values and gradients at all points with noise on its diagonal; only the upper triangle is filled.

    Args:
        points: shape (n, d).
        value, first, second: profile of the kernel for all pairs, shape (n, n).
        noise_variance: shape (n + n d,).
        jitter: added to the diagonal, relative to it.
    """
    n, dimension = points.shape
    matrix = np.empty((n * (dimension + 1), n * (dimension + 1)))
    for a in range(n):
        for b in range(n):
            slope, bend = -2.0 * first[a, b], -4.0 * second[a, b]
            matrix[a, b] = value[a, b]
            for j in range(dimension):
                delta_j = points[a, j] - points[b, j]
                column = n + j * n + b
                matrix[a, column] = slope * delta_j
                for i in range(j):
                    matrix[n + i * n + a, column] = bend * (points[a, i] - points[b, i]) * delta_j
                matrix[n + j * n + a, column] = bend * delta_j * delta_j + slope
    for row in range(len(matrix)):
        matrix[row, row] += jitter * matrix[row, row] + noise_variance[row]
    return matrix


@compile_when_called
def pull(points: Array, first: Array, second: Array, third: Array, inverse: Array, weights: Array) -> Array:
    """Derivative by each point of ``sum((inverse - weights weights^T) * K) / 2``, K as in :func:`assemble`.

    Every pair adds ``A phi + 2 phi' c.d - 4 phi'' d.M.d - 2 phi' tr M`` with A, c and M picked from the factor of K;
    its derivative by d needs the third derivative of phi.

    Args:
        points: shape (n, d).
        first, second, third: derivatives of the kernel's profile for all pairs, shape (n, n).
        inverse: of the covariance; only its lower triangle is read.
        weights: the covariance's inverse times the residuals.

    Returns:
        Shape (n, d).
    """
    n, dimension = points.shape
    result = np.zeros((n, dimension))
    delta, cross, turned = np.empty(dimension), np.empty(dimension), np.empty(dimension)
    for a in range(n):
        for b in range(a):
            on_value = inverse[a, b] - weights[a] * weights[b]
            linear, trace, quadratic = 0.0, 0.0, 0.0
            for i in range(dimension):
                delta[i] = points[a, i] - points[b, i]
                row, other = n + i * n + a, n + i * n + b
                cross[i] = inverse[row, b] - weights[row] * weights[b] - inverse[other, a] + weights[other] * weights[a]
                linear += cross[i] * delta[i]
                trace += inverse[row, other] - weights[row] * weights[other]
            for i in range(dimension):
                turned[i] = 0.0
                for j in range(dimension):
                    turned[i] += (points[a, j] - points[b, j]) * (
                        _symmetric(inverse, n + i * n + a, n + j * n + b)
                        + _symmetric(inverse, n + j * n + a, n + i * n + b)
                        - weights[n + i * n + a] * weights[n + j * n + b]
                        - weights[n + j * n + a] * weights[n + i * n + b]
                    )
                quadratic += 0.5 * turned[i] * delta[i]
            radial = on_value * first[a, b] + 2.0 * (linear - trace) * second[a, b] - 4.0 * quadratic * third[a, b]
            for i in range(dimension):
                slope = 2.0 * delta[i] * radial + 2.0 * cross[i] * first[a, b] - 4.0 * turned[i] * second[a, b]
                result[a, i] += slope
                result[b, i] -= slope
    return result


@compile_when_called
def _symmetric(lower: Array, row: int, column: int) -> float:
    return float(lower[row, column] if row >= column else lower[column, row])
