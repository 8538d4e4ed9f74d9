"""Chances without ``scipy.stats``, which takes a fifth of the time in which a session starts."""

from __future__ import annotations

import numpy as np
from scipy.special import gammaincc, gammainccinv, gammaincinv, gammaln

from drivers.core.contacts import Array


def chi_squared_quantile(confidence: float, degrees: int) -> float:
    """The value below which the squared Mahalanobis distance of a deviation stays with a given probability.

    Args:
        confidence: that probability, 0..1.
        degrees: of freedom, 1 or more.
    """
    return 2.0 * float(gammaincinv(degrees / 2.0, confidence))


def chi_squared_exceeded_by(chance: float, degrees: int) -> float:
    """The value above which a squared Mahalanobis distance is with a given, perhaps tiny, probability.

    Args:
        chance: that probability, 0..1.
        degrees: of freedom, 1 or more.
    """
    return 2.0 * float(gammainccinv(degrees / 2.0, chance))


def chi_squared_tail(squared: Array, degrees: int) -> Array:
    """The probability of a larger squared Mahalanobis distance than each of those given, 0..1.

    Args:
        squared: distances, of any shape.
        degrees: of freedom, 1 or more.
    """
    return np.asarray(gammaincc(degrees / 2.0, np.asarray(squared) / 2.0))


def hypergeometric_tail(least: int, total: int, marked: int, drawn: int) -> float:
    """The probability that at least so many of things drawn without looking are marked, 0..1.

    Args:
        least: how many, 0 or more.
        total: things in all.
        marked: marked ones among them.
        drawn: things drawn.
    """
    counts = np.arange(max(least, drawn + marked - total, 0), min(marked, drawn) + 1, dtype=float)
    ways = _log_ways(marked, counts) + _log_ways(total - marked, drawn - counts)
    return min(1.0, float(np.exp(ways - _log_ways(total, np.array(float(drawn)))).sum()))


def _log_ways(things: int, chosen: Array) -> Array:
    """Natural logarithm of the number of ways in which so many of some things can be chosen."""
    ways: Array = gammaln(things + 1.0) - gammaln(chosen + 1.0) - gammaln(things - chosen + 1.0)
    return ways
