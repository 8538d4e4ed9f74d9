"""Scrambled Sobol points in up to six dimensions, as ``scipy.stats`` draws them, without its third of a second to load.

Direction numbers are those of Joe and Kuo, "Constructing Sobol sequences with better two-dimensional projections", SIAM
Journal on Scientific Computing 30 (2008); scrambled by random lower triangular matrices and a random shift (Matousek,
"On the L2-discrepancy for anchored boxes", Journal of Complexity 14, 1998).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array

_BITS = 30
_POLYNOMIALS = ((), (1,), (1, 1), (0, 1, 1), (1, 0, 1), (0, 0, 1, 1))
"""Of each dimension a primitive polynomial over two elements: its coefficients behind the leading one, highest degree
first. The first dimension has none.
"""
_FIRST_NUMBERS = ((), (1,), (1, 3), (1, 3, 1), (1, 1, 1), (1, 1, 3, 3))
MOST_DIMENSIONS = len(_POLYNOMIALS)


def sobol_points(count: int, dimensions: int, rng: np.random.Generator) -> Array:
    """The first points of a scrambled sequence, shape (count, dimensions), 0..1.

    Args:
        count: of points, at most 2**30.
        dimensions: 1 to :data:`MOST_DIMENSIONS`.
        rng: scrambles them.
    """
    powers = 1 << np.arange(_BITS, dtype=np.uint32)
    shift = rng.integers(2, size=(dimensions, _BITS), dtype=np.uint32) @ powers
    mixing = np.tril(rng.integers(2, size=(dimensions, _BITS, _BITS), dtype=np.uint32))
    mixing[:, np.arange(_BITS), np.arange(_BITS)] = 1
    plain = np.array([_digits(dimension) for dimension in range(dimensions)])
    directions = np.einsum("dpk,djk->djp", mixing, plain) % 2 @ powers[::-1]
    numbers = np.arange(count, dtype=np.uint32)
    steps = numbers ^ numbers >> 1  # Gray code: which directions lead to a point
    points = np.tile(shift, (count, 1))
    for bit in range(int(count - 1).bit_length()):
        points[steps >> bit & 1 == 1] ^= directions[:, bit]
    return points * 0.5**_BITS


def _digits(dimension: int) -> NDArray[np.uint32]:
    """A dimension's direction numbers as binary digits behind the point, shape (numbers, digits), highest first."""
    polynomial, numbers = _POLYNOMIALS[dimension], list(_FIRST_NUMBERS[dimension])
    degree = len(polynomial)
    while len(numbers) < _BITS:
        before = numbers[::-1][:degree] if degree else []
        following = before[-1] if before else 1
        for power, (coefficient, number) in enumerate(zip(polynomial, before, strict=True), 1):
            following ^= coefficient * number << power
        numbers.append(following)
    shifted = np.array([number << _BITS - 1 - place for place, number in enumerate(numbers)])
    return (shifted[:, None] >> np.arange(_BITS)[::-1] & 1).astype(np.uint32)
