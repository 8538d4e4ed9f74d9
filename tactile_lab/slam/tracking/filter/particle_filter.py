"""The particle filter of algorithm 3.1 over planar poses of the object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.tracking.contacts.motion import MotionNoise, deviation, sample_motion

CERTAIN_VARIANCE = 1e-10
"""Variance of a given pose, or of the pose that defines the object frame: certain up to rounding."""


@dataclass(frozen=True)
class PoseEstimate:
    """An estimate of ``world_T_object`` in the plane.

    Attributes:
        pose: (x_m, y_m, yaw_rad).
        covariance: shape (3, 3), of the same components.
    """

    pose: Array
    covariance: Array


@dataclass(frozen=True)
class Belief:
    """A weighted set of particles (eq. 3.4).

    Attributes:
        rows: particles, planar poses of shape (n, 3).
        weights: shape (n,), summing to one.
    """

    rows: Array
    weights: Array

    @classmethod
    def certain(cls, row: Array, count: int) -> Belief:
        """All particles at one pose."""
        return cls(np.tile(row, (count, 1)), np.full(count, 1.0 / count))

    @property
    def effective_count(self) -> float:
        """Effective number of particles, ``1 / sum w^2``."""
        return float(1.0 / np.sum(self.weights**2))

    def predict(self, motion: Array, noise: MotionNoise, rng: np.random.Generator) -> Belief:
        """Sampling: every particle moves by the motion model (eq. 3.7); weights stay."""
        return Belief(sample_motion(self.rows, motion, noise, rng), self.weights)

    def weight(self, log_likelihood: Array) -> Belief | None:
        """Weighting and normalising (eq. 3.6); None when every particle has likelihood zero.

        Args:
            log_likelihood: shape (n,), minus infinity for a likelihood of zero.
        """
        with np.errstate(divide="ignore"):
            log_weights = np.log(self.weights) + log_likelihood
        highest = log_weights.max()
        if not np.isfinite(highest):
            return None
        weights = np.exp(log_weights - highest)
        return Belief(self.rows, weights / weights.sum())

    def estimate(self) -> PoseEstimate:
        """The weighted mean (algorithm 3.1) and the covariance of the particles (eq. 3.23).

        Angles are averaged on the circle.
        """
        mean = self.weights @ self.rows
        mean[2] = np.arctan2(self.weights @ np.sin(self.rows[:, 2]), self.weights @ np.cos(self.rows[:, 2]))
        spread = deviation(self.rows, mean)
        return PoseEstimate(mean, (spread * self.weights[:, None]).T @ spread)

    def resample(self, rng: np.random.Generator) -> Belief:
        """Resampling (systematic) if fewer than half the particles are effective, otherwise unchanged."""
        count = len(self.weights)
        if self.effective_count >= count / 2:
            return self
        ticks = (rng.random() + np.arange(count)) / count
        chosen = np.minimum(np.searchsorted(np.cumsum(self.weights), ticks), count - 1)
        return Belief(self.rows[chosen], np.full(count, 1.0 / count))
