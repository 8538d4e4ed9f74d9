"""Uncertainty of the surface by the Gaussian process (thesis section 4.4.4)."""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array

POINT_SIGMA_m = 0.001
"""Default standard deviation of a contact along its normal."""

_JITTER = 1e-9


def log_determinant(covariance: Array) -> float:
    """Log determinant of a covariance, shape (q, q); a very small number if rounding made it singular."""
    size = max(float(np.trace(covariance)) / max(len(covariance), 1), np.finfo(float).tiny)
    return float(np.linalg.slogdet(covariance + _JITTER * size * np.eye(len(covariance)))[1])


def contact_entropy(covariance: Array, point_sigma_m: float = POINT_SIGMA_m) -> float:
    """Equations 4.9 and 4.10 for contacts that are expected where the field has this posterior covariance, nats.

    ``log det K*`` with the expected contacts bordering the present ones is ``log det K`` plus the logarithm of the
    determinant of their posterior covariance, shape (q, q). The first is the same for all candidates and left out, so
    that a grasp without contacts has 0. The measurement's noise is part of the covariance: without it a second touch
    of the same place would count as minus infinity. Relative to the noise, so that the value is a pure number.
    """
    return log_determinant(covariance / point_sigma_m**2 + np.eye(len(covariance))) if len(covariance) else 0.0
