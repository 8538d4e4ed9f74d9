"""The inner sums of the trajectory's likelihood, over all pairs of contacts at once.

Rows and columns of the matrices are ordered as in :func:`tactile_lab.slam.shape.fields.kernels.covariance`: all values,
then the gradients' first components, then their second ones, and so on. Differences are ``d = p_a - p_b``.
"""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array


def assemble(points: Array, value: Array, first: Array, second: Array, noise_variance: Array, jitter: float) -> Array:
    """Covariance of values and gradients at all points with noise on its diagonal; only the upper triangle counts.

    Args:
        points: shape (n, d).
        value, first, second: profile of the kernel for all pairs, shape (n, n).
        noise_variance: shape (n + n d,).
        jitter: added to the diagonal, relative to it.
    """
    n, dimension = points.shape
    matrix = np.empty((n * (dimension + 1), n * (dimension + 1)))
    blocks = matrix.reshape(dimension + 1, n, dimension + 1, n)
    deltas = _differences(points)
    slope = -2.0 * first
    bends = (-4.0 * second) * deltas
    blocks[0, :, 0] = value
    for j, delta in enumerate(deltas, 1):
        np.multiply(slope, delta, out=blocks[0, :, j])
        for i in range(j):
            np.multiply(bends[i], delta, out=blocks[i + 1, :, j])
        blocks[j, :, j] += slope
    diagonal = np.einsum("ii->i", matrix)
    diagonal += jitter * diagonal + noise_variance
    return matrix


def pull(points: Array, first: Array, second: Array, third: Array, inverse: Array, weights: Array) -> Array:
    """Derivative by each point of ``sum((inverse - weights weights^T) * K) / 2``, K as in :func:`assemble`.

    Every pair adds ``A phi + 2 phi' c.d - 4 phi'' d.M.d - 2 phi' tr M`` with A, c and M picked from the factor of K;
    its derivative by d needs the third derivative of phi.

    Args:
        points: shape (n, d).
        first, second, third: derivatives of the kernel's profile for all pairs, shape (n, n).
        inverse: the lower triangle of the covariance's inverse, zero above it.
        weights: the covariance's inverse times the residuals.

    Returns:
        Shape (n, d).
    """
    n, dimension = points.shape
    deltas = _differences(points)
    factor = inverse + inverse.T
    np.einsum("ii->i", factor)[:] *= 0.5
    factor -= np.multiply.outer(weights, weights)
    blocks = factor.reshape(dimension + 1, n, dimension + 1, n)
    linear, trace = np.zeros((n, n)), np.zeros((n, n))
    cross, turned = np.empty_like(deltas), np.zeros_like(deltas)
    for i, delta in enumerate(deltas):
        np.subtract(blocks[i + 1, :, 0], blocks[i + 1, :, 0].T, out=cross[i])
        linear += cross[i] * delta
        trace += blocks[i + 1, :, i + 1]
        turned[i] += 2.0 * delta * blocks[i + 1, :, i + 1]
        for j in range(i):
            both = blocks[i + 1, :, j + 1] + blocks[j + 1, :, i + 1]
            turned[i] += deltas[j] * both
            turned[j] += delta * both
    quadratic = np.einsum("iab,iab->ab", turned, deltas)
    radial = blocks[0, :, 0] * first + 2.0 * (linear - trace) * second - 2.0 * quadratic * third
    slopes = 2.0 * (deltas * radial + cross * first) - 4.0 * turned * second
    return np.ascontiguousarray(slopes.sum(axis=2).T)


def _differences(points: Array) -> Array:
    """Shape (d, n, n)."""
    return np.asarray(points.T[:, :, None] - points.T[:, None, :])
