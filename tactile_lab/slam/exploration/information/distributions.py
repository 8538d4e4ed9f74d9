"""Entropy, mutual information and divergence of discrete distributions, such as a particle filter's weights.

All in nats. Weights need not sum to one; terms with probability zero contribute nothing.
"""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array


def shannon_entropy(weights: Array) -> float:
    """Equation 4.3, ``-sum w log w``: from 0 (one certain particle) to ``log n`` (all alike), weights of shape (n,)."""
    shares = _normalise(weights)
    held = shares[shares > 0]
    return max(0.0, float(-np.sum(held * np.log(held))))


def renyi_entropy(weights: Array, order: float) -> float:
    """Renyi entropy ``log(sum w^a) / (1 - a)`` of order a >= 0; order 1 is Shannon's.

    Equation 4.4 of the thesis prints ``sum w log w / (1 - a)`` instead: that is Shannon's entropy times a constant, so
    the order would change no comparison, and it does not tend to Shannon's entropy for a -> 1. This is the standard
    definition (Renyi 1961).

    Raises:
        ValueError: a negative order.
    """
    if order < 0:
        raise ValueError(f"the order of Renyi's entropy is not negative, and {order:g} is")
    if abs(order - 1.0) < 1e-6:
        return shannon_entropy(weights)
    shares = _normalise(weights)
    if np.isinf(order):
        return float(-np.log(shares.max()))
    return float(np.log(np.sum(shares[shares > 0] ** order)) / (1.0 - order))


def mutual_information(prior: Array, posterior: Array) -> float:
    """Equation 4.5, ``H(x) - H(x | z)``: reduction of entropy by a measurement; may be negative."""
    return shannon_entropy(prior) - shannon_entropy(posterior)


def kl_divergence(of: Array, to: Array) -> float:
    """Equation 4.6, ``sum P log(P / Q)``: infinite where Q excludes what P holds possible.

    The thesis names P the prior and Q the posterior. A measurement's gain is usually read the other way round, with
    the posterior first, which stays finite when the measurement excludes particles; callers choose by the order.
    """
    first, second = _normalise(of), _normalise(to)
    held = first > 0
    if np.any(second[held] == 0):
        return float("inf")
    return max(0.0, float(np.sum(first[held] * np.log(first[held] / second[held]))))


def _normalise(weights: Array) -> Array:
    """Normalized weights. Raises ValueError if they are not a distribution."""
    weights = np.asarray(weights, dtype=float)
    total = float(weights.sum()) if len(weights) else 0.0
    if not (np.isfinite(total) and total > 0 and weights.min() >= 0):
        raise ValueError("weights of a distribution are not negative and not all zero")
    return weights / total
