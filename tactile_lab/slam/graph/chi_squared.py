"""The chi-squared distribution without ``scipy.stats``, which takes a fifth of the time in which a session starts."""

from __future__ import annotations

from scipy.special import gammaincinv


def chi_squared_quantile(confidence: float, degrees: int) -> float:
    """The value below which the squared Mahalanobis distance of a deviation stays with a given probability.

    Args:
        confidence: that probability, 0..1.
        degrees: of freedom, 1 or more.
    """
    return 2.0 * float(gammaincinv(degrees / 2.0, confidence))
