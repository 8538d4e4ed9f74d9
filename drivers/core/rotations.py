"""Rotation vectors: exponential and logarithm of rotations and their derivatives, for many at once.

A rotation vector w stands for ``R = exp([w]x)``; its length is the angle. Formulas are the closed ones of the
rotation group, with series where the angle is so small that they would divide by zero.
"""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array

_SMALL_rad = 1e-4


def skew(vectors: Array) -> Array:
    """Matrices of the cross product with vectors of shape (..., 3), shape (..., 3, 3)."""
    result = np.zeros((*vectors.shape, 3))
    result[..., 0, 1], result[..., 0, 2] = -vectors[..., 2], vectors[..., 1]
    result[..., 1, 0], result[..., 1, 2] = vectors[..., 2], -vectors[..., 0]
    result[..., 2, 0], result[..., 2, 1] = -vectors[..., 1], vectors[..., 0]
    return result


def exponential(vectors: Array) -> Array:
    """Rotation matrices of rotation vectors of shape (..., 3), shape (..., 3, 3)."""
    angle = np.linalg.norm(vectors, axis=-1)
    first, second, _ = _coefficients(angle)
    cross = skew(vectors)
    return np.asarray(np.eye(3) + first[..., None, None] * cross + second[..., None, None] * (cross @ cross))


def logarithm(rotations: Array) -> Array:
    """Rotation vectors of rotation matrices of shape (..., 3, 3), angles up to pi, shape (..., 3).

    By quaternions, whose largest component never vanishes, so that half turns are no exception.
    """
    return _vectors_of(_quaternions(rotations))


def right_jacobian(vectors: Array) -> Array:
    """J with ``exp(w + dw) = exp(w) exp(J dw)`` for small dw, shape (..., 3, 3)."""
    angle = np.linalg.norm(vectors, axis=-1)
    _, second, third = _coefficients(angle)
    cross = skew(vectors)
    return np.asarray(np.eye(3) - second[..., None, None] * cross + third[..., None, None] * (cross @ cross))


def _coefficients(angle: Array) -> tuple[Array, Array, Array]:
    """sin(a) / a, (1 - cos a) / a^2 and (a - sin a) / a^3."""
    small = angle < _SMALL_rad
    safe = np.where(small, 1.0, angle)
    squared = angle**2
    first = np.where(small, 1 - squared / 6, np.sin(safe) / safe)
    second = np.where(small, 0.5 - squared / 24, 2 * (np.sin(safe / 2) / safe) ** 2)
    third = np.where(small, 1 / 6 - squared / 120, (safe - np.sin(safe)) / safe**3)
    return first, second, third


def _quaternions(rotations: Array) -> Array:
    """Unit quaternions (w, x, y, z), w not negative, shape (..., 4)."""
    m = rotations
    trace = m[..., 0, 0] + m[..., 1, 1] + m[..., 2, 2]
    products = np.empty((*m.shape[:-2], 4, 4))
    products[..., 0, 0] = 1 + trace
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        products[..., i + 1, i + 1] = 1 + 2 * m[..., i, i] - trace
        products[..., 0, i + 1] = products[..., i + 1, 0] = m[..., k, j] - m[..., j, k]
        products[..., i + 1, j + 1] = products[..., j + 1, i + 1] = m[..., i, j] + m[..., j, i]
    largest = np.einsum("...ii->...i", products).argmax(axis=-1)
    rows = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    rows = rows / np.linalg.norm(rows, axis=-1, keepdims=True)
    return np.asarray(np.where(rows[..., :1] < 0, -rows, rows))


def _vectors_of(quaternions: Array) -> Array:
    imaginary = quaternions[..., 1:]
    length = np.linalg.norm(imaginary, axis=-1)
    angle = 2 * np.arctan2(length, quaternions[..., 0])
    factor = np.where(length < _SMALL_rad, 2.0, angle / np.where(length < _SMALL_rad, 1.0, length))
    return np.asarray(factor[..., None] * imaginary)
