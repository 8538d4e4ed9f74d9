"""Spread of particles of a planar pose, as one Gaussian and as several.

Rows are (x m, y m, yaw rad); angles are averaged on the circle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage

from drivers.core.contacts import Array
from tactile_lab.slam.tracking.contacts.motion import deviation

ARM_m = 0.030
"""Length that makes a turn comparable with a shift: about half an object that fits into the hand."""

_MOST_LINKED = 150
_SMALLEST_VARIANCE = 1e-12


@dataclass(frozen=True)
class Mode:
    """One cluster of particles.

    Attributes:
        weight: its share of all.
        mean: shape (3,).
        covariance: within the cluster, shape (3, 3).
    """

    weight: float
    mean: Array
    covariance: Array


def weighted_mean(rows: Array, weights: Array) -> Array:
    """Mean pose of particles, shape (3,)."""
    shares = weights / weights.sum()
    mean = np.asarray(shares @ rows)
    mean[2] = np.arctan2(shares @ np.sin(rows[:, 2]), shares @ np.cos(rows[:, 2]))
    return mean


def weighted_covariance(rows: Array, weights: Array) -> Array:
    """Equation 4.21: ``sum w (x - m)(x - m)' / (1 - sum w^2)``, shape (3, 3).

    Where one particle holds all weight the denominator vanishes; the covariance is then zero.
    """
    shares = weights / weights.sum()
    spread = deviation(rows, weighted_mean(rows, shares))
    freedom = 1.0 - float(np.sum(shares**2))
    return np.asarray((spread * shares[:, None]).T @ spread / freedom) if freedom > 1e-9 else np.zeros((3, 3))


def determinant(covariance: Array) -> float:
    """The scalar that the thesis reads off (4.21), m^4 rad^2; not negative."""
    return max(0.0, float(np.linalg.det(covariance)))


def gaussian_entropy(covariance: Array) -> float:
    """Differential entropy of a Gaussian pose, nats; directions known exactly count as known to a micrometre."""
    values = np.maximum(np.linalg.eigvalsh(covariance), _SMALLEST_VARIANCE)
    return float(0.5 * np.sum(np.log(2 * np.pi * np.e * values)))


def modes(rows: Array, weights: Array, apart_m: float = 0.020) -> tuple[Mode, ...]:
    """Clusters of particles whose gaps exceed ``apart_m`` (a turn counts with :data:`ARM_m`), the heaviest first.

    Section 4.6 of the thesis asks for this: one Gaussian misjudges a belief with several modes. Up to 150 evenly
    chosen particles are linked (single linkage); the others join the nearest of them.
    """
    scaled = np.column_stack([rows[:, :2], ARM_m * np.cos(rows[:, 2]), ARM_m * np.sin(rows[:, 2])])
    chosen = np.linspace(0, len(rows) - 1, min(len(rows), _MOST_LINKED)).astype(int)
    labels = fcluster(linkage(scaled[chosen]), apart_m, "distance") if len(chosen) > 1 else np.ones(1, dtype=int)
    nearest = np.linalg.norm(scaled[:, None] - scaled[chosen][None], axis=-1).argmin(axis=1)
    heaps = [np.flatnonzero(labels[nearest] == label) for label in np.unique(labels)]
    found = [_mode(rows[heap], weights[heap], float(weights.sum())) for heap in heaps if weights[heap].sum() > 0]
    return tuple(sorted(found, key=lambda mode: -mode.weight))


def mixture_entropy(parts: tuple[Mode, ...]) -> float:
    """Entropy of a mixture of well separated Gaussians, nats: of the choice of mode, and within it.

    Exact where the modes do not overlap, an upper bound otherwise. The determinant of (4.21) would count the empty
    space between the modes as uncertainty; this does not.
    """
    return float(sum(part.weight * (gaussian_entropy(part.covariance) - np.log(part.weight)) for part in parts))


def _mode(rows: Array, weights: Array, total: float) -> Mode:
    return Mode(float(weights.sum()) / total, weighted_mean(rows, weights), weighted_covariance(rows, weights))
