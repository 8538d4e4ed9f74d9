"""The law of measured steps: how far an object that the fingertips felt moving is off what they felt.

Student's t with five degrees of freedom and the stated standard deviations, in place and turn: a step said to be good
to half a millimetre may be off by five. The degrees were fitted to carries of the simulated rig (decision 166).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ndtri, stdtr

from drivers.core.contacts import Array

_FREEDOM = 5.0
_SCALE = float(np.sqrt((_FREEDOM - 2) / _FREEDOM))
"""Of Student's t whose standard deviation is 1."""
_FEW = 0.17
"""Of so small a share that is not 0 the most likely spread is 0."""


def heavy_tailed_cost(squared: Array, dimensions: NDArray[np.int_]) -> Array:
    """Negative log density of slips of measured steps, up to a constant; 10 standard deviations cost 12 nats, not 50.

    Args:
        squared: their lengths over their standard deviations, squared, shape (..., n).
        dimensions: of each, shape (n,).
    """
    return np.asarray((_FREEDOM + dimensions) / 2 * np.log1p(squared / (_FREEDOM - 2)))


def heavy_tailed_weight(squared: Array, dimensions: NDArray[np.int_]) -> Array:
    """Derivative of :func:`heavy_tailed_cost`, relative to that of the normal distribution's."""
    return np.asarray((_FREEDOM + dimensions) / (_FREEDOM - 2 + squared))


def as_normal(ratios: Array) -> Array:
    """Errors along an axis over their standard deviations, any shape, as those that a normal distribution has as often.

    So 68.3, 95.4 and 99.7 % of what follows the law are within 1, 2 and 3: 0.86, 2.05 and 4.27 standard deviations.
    """
    return np.asarray(np.copysign(ndtri(stdtr(_FREEDOM, -np.abs(ratios) / _SCALE)), ratios))


def spread(ratios: Array) -> float:
    """The most likely standard deviation of errors that follow the law, shape (n,); far ones hardly widen it. 0 where
    few are off at all.
    """
    largest = float(np.abs(ratios).max()) or 1.0
    squared = np.square(ratios / largest)
    if np.count_nonzero(squared) <= _FEW * len(squared):
        return 0.0

    def excess(variance: float) -> float:
        """By how much more than once each error weighs; the most likely variance leaves nothing."""
        over = squared / variance
        return float(np.mean((_FREEDOM + 1) * over / (_FREEDOM - 2 + over))) - 1

    return largest * float(np.sqrt(brentq(excess, 1e-3 * squared[squared > 0].min(), 2.0)))
