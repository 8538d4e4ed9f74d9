"""The motion model (3.7) along a whole trajectory, as a cost with derivatives."""

from __future__ import annotations

import numpy as np

from tactile_lab.geometry.contacts import Array
from tactile_lab.tracking.motion import MotionNoise
from tactile_lab.tracking.pose_rows import PoseRows

STIFF_BEYOND_SIGMA = 3.2
_STIFFNESS = 10.0
"""Slips are bounded by the hand's grip: beyond some sigma the motion prior gets stiffer than a Gaussian."""


class MotionCost:
    """Negative log probability of the slips between successive poses, up to a constant."""

    def __init__(self, motions: Array, noise: MotionNoise, space: PoseRows) -> None:
        """
        Args:
            motions: of the hand before each grasp, shape (k, size); the first is not used.
            noise: of a re-orientation.
            space: what the rows mean.
        """
        self._motions, self._space, self._sigmas = motions, space, space.sigmas(noise)

    def value(self, rows: Array) -> float:
        """The cost of poses of shape (k, size)."""
        return float(self._cost(self._scaled(rows)))

    def value_and_gradient(self, rows: Array) -> tuple[float, Array]:
        """The cost and its derivative by each pose, shape (k, size)."""
        scaled = self._scaled(rows)
        slip = self._lengths(scaled)
        excess = np.maximum(slip - STIFF_BEYOND_SIGMA, 0.0)
        stretch = np.repeat(1 + _STIFFNESS * excess / np.maximum(slip, 1e-12), self._parts, axis=1)
        pull = scaled * stretch / self._sigmas
        later, earlier = self._space.slip_derivatives(rows, self._motions)
        gradient = np.zeros_like(rows)
        gradient[1:] += np.einsum("kij,ki->kj", later, pull)
        gradient[:-1] += np.einsum("kij,ki->kj", earlier, pull)
        return float(self._cost(scaled)), gradient

    def information(self, rows: Array) -> Array:
        """Second derivative by all poses but the first, slips taken as Gaussian; shape ((k - 1) size, (k - 1) size)."""
        count, size = len(rows) - 1, self._space.size
        later, earlier = self._space.slip_derivatives(rows, self._motions)
        by_rows = np.zeros((count, size, count, size))
        index = np.arange(count)
        by_rows[index, :, index] = later
        by_rows[index[1:], :, index[:-1]] = earlier[1:]
        scaled = (by_rows / self._sigmas[:, None, None]).reshape(count * size, count * size)
        return np.asarray(scaled.T @ scaled)

    def slips_in_sigma(self, rows: Array) -> Array:
        """Lengths of translation and rotation of each slip over their standard deviations, shape (k - 1, 2)."""
        return self._lengths(self._scaled(rows))

    @property
    def _parts(self) -> list[int]:
        return [self._space.translations, self._space.size - self._space.translations]

    def _scaled(self, rows: Array) -> Array:
        return self._space.deviation(rows[1:], self._space.compose(self._motions[1:], rows[:-1])) / self._sigmas

    def _lengths(self, scaled: Array) -> Array:
        split = self._space.translations
        return np.stack([np.linalg.norm(scaled[:, :split], axis=1), np.linalg.norm(scaled[:, split:], axis=1)], axis=1)

    def _cost(self, scaled: Array) -> Array:
        slip = self._lengths(scaled)
        excess = np.maximum(slip - STIFF_BEYOND_SIGMA, 0.0)
        return np.asarray(0.5 * np.sum(slip**2) + 0.5 * _STIFFNESS * np.sum(excess**2))
