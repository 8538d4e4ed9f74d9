"""The motion model (3.7) along a whole trajectory, as a cost with derivatives."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from tactile_lab.geometry.contacts import Array
from tactile_lab.tracking.contact_map import ContactMap
from tactile_lab.tracking.motion import MotionNoise
from tactile_lab.tracking.pose_rows import PoseRows

STIFF_BEYOND_SIGMA = 3.2
_STIFFNESS = 10.0
"""Slips are bounded by the hand's grip: beyond some sigma the motion prior gets stiffer than a Gaussian."""


_HARDLY = 1e-3
"""Certainty of a motion that the object did not follow: not zero, so that a pose nothing touches is still a pose."""


_CONFIGURED_SLIPS = 6.0

PUSHED_SHARE = 0.05
"""Of the grasps that were to leave the object where it is: a hand that closes on a corner turns it all the same."""


class MotionCost:
    """Negative log probability of the slips between successive poses, up to a constant."""

    def __init__(
        self, motions: Array, noise: MotionNoise, space: PoseRows, follows: NDArray[np.bool_] | None = None
    ) -> None:
        """
        Args:
            motions: of the hand before each grasp, shape (k, size); the first is not used.
            noise: of a re-orientation.
            space: what the rows mean.
            follows: whether the object followed the hand before each grasp, shape (k,); slips of other steps cost
                nothing. None: always.
        """
        self._motions, self._space = motions, space
        certainty = np.ones(len(motions)) if follows is None else np.where(follows, 1.0, _HARDLY)
        carried = np.asarray(motions.any(axis=1))
        certainty = np.where(carried, certainty, certainty / noise.left_lying)
        self._weights = certainty[1:, None] / space.sigmas(noise)
        self._left = noise.left_lying
        self._is_left: NDArray[np.bool_] = ~carried[1:] & np.bool_(noise.left_lying < 1)

    @classmethod
    def of(cls, contact_map: ContactMap, noise: MotionNoise) -> Self:
        """Along the trajectory of a map."""
        return cls(contact_map.motions, noise, contact_map.space, contact_map.follows_hand)

    def value(self, rows: Array) -> float:
        """The cost of poses of shape (k, size)."""
        return self._cost(self._lengths(self._scaled(rows)))

    def value_and_gradient(self, rows: Array) -> tuple[float, Array]:
        """The cost and its derivative by each pose, shape (k, size)."""
        scaled = self._scaled(rows)
        slip = self._lengths(scaled)
        excess = np.maximum(slip - STIFF_BEYOND_SIGMA, 0.0)
        stiff = 1 + _STIFFNESS * excess / np.maximum(slip, 1e-12)
        held = np.where(self._is_left[:, None], self._held(slip)[:, None], stiff)
        pull = scaled * np.repeat(held, self._parts, axis=1) * self._weights
        later, earlier = self._space.slip_derivatives(rows, self._motions)
        gradient = np.zeros_like(rows)
        gradient[1:] += np.einsum("kij,ki->kj", later, pull)
        gradient[:-1] += np.einsum("kij,ki->kj", earlier, pull)
        return self._cost(slip), gradient

    def information(self, rows: Array) -> Array:
        """Second derivative by all poses but the first, slips taken as Gaussian; shape ((k - 1) size, (k - 1) size)."""
        count, size = len(rows) - 1, self._space.size
        later, earlier = self._space.slip_derivatives(rows, self._motions)
        by_rows = np.zeros((count, size, count, size))
        index = np.arange(count)
        by_rows[index, :, index] = later
        by_rows[index[1:], :, index[:-1]] = earlier[1:]
        weights = self._weights * np.sqrt(self._held(self._lengths(self._scaled(rows))))[:, None]
        scaled = (by_rows * weights[:, :, None, None]).reshape(count * size, count * size)
        return np.asarray(scaled.T @ scaled)

    def slips_in_sigma(self, rows: Array) -> Array:
        """Lengths of translation and rotation of each slip over their standard deviations, shape (k - 1, 2)."""
        slip = self._lengths(self._scaled(rows))
        return np.asarray(slip * np.sqrt(self._held(slip))[:, None])

    @property
    def _parts(self) -> list[int]:
        return [self._space.translations, self._space.size - self._space.translations]

    def _scaled(self, rows: Array) -> Array:
        slips = self._space.deviation(rows[1:], self._space.compose(self._motions[1:], rows[:-1]))
        return np.asarray(slips * self._weights)

    def _lengths(self, scaled: Array) -> Array:
        return np.sqrt(np.add.reduceat(scaled**2, [0, self._space.translations], axis=1))

    def _cost(self, slip: Array) -> float:
        carried = slip[~self._is_left]
        excess = np.maximum(carried - STIFF_BEYOND_SIGMA, 0.0)
        left, pushed = self._left_or_pushed(slip[self._is_left])
        bound = 0.5 * np.sum(carried**2) + 0.5 * _STIFFNESS * np.sum(excess**2)
        return float(bound - np.sum(np.logaddexp(left, pushed)))

    def _held(self, slip: Array) -> Array:
        """What is left of a Gaussian's pull at each slip, shape (k - 1,): less where the object was pushed."""
        left, pushed = self._left_or_pushed(slip)
        return np.where(self._is_left, 1 - expit(pushed - left) * (1 - self._left**2), 1.0)

    def _left_or_pushed(self, slip: Array) -> tuple[Array, Array]:
        """Log probabilities of slips of an object that was left where it is, or was pushed, less the former's norm."""
        squared = np.sum(slip**2, axis=1)
        pushed = -pushed_nats(self._left, self._space) - 0.5 * self._left**2 * squared
        return np.log1p(-PUSHED_SHARE) - 0.5 * squared, pushed


def pushed_nats(left_lying: float, space: PoseRows) -> float:
    """What it costs that an object was pushed that was to be left where it is, before how far is looked at."""
    return -float(np.log(PUSHED_SHARE) + space.size * np.log(left_lying))


def estimated_noise(contact_map: ContactMap, configured: MotionNoise) -> MotionNoise:
    """The noise that the slips of a trajectory speak for, the configured one counting as several of them."""
    cost = MotionCost.of(contact_map, configured)
    slips = cost.slips_in_sigma(contact_map.rows)[contact_map.follows_hand[1:]]
    translations, size = contact_map.space.translations, contact_map.space.size
    freedom = np.array([translations, size - translations])
    variance = (_CONFIGURED_SLIPS + np.sum(slips**2, axis=0) / freedom) / (_CONFIGURED_SLIPS + len(slips))
    ratio = np.sqrt(variance)
    translation_m, rotation_rad = float(configured.translation_m * ratio[0]), float(configured.rotation_rad * ratio[1])
    return configured.model_copy(update={"translation_m": translation_m, "rotation_rad": rotation_rad})
