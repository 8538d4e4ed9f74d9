"""The motion model (3.7) along a whole trajectory, as a cost with derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array, StepSigma
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, Moved
from tactile_lab.slam.tracking.contacts.measured_law import heavy_tailed_cost, heavy_tailed_weight
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.contacts.pose_vectors import PoseVectors

STIFF_BEYOND_SIGMA = 3.2
_STIFFNESS = 10.0
"""Slips are bounded by the hand's grip: beyond some sigma the motion prior gets stiffer than a Gaussian."""


_HARDLY = 1e-3
"""Weight of a motion that the object did not follow: not zero, so that a pose without contacts is still determined."""


_CONFIGURED_SLIPS = 6.0

_PUSHED = 0.6
"""Size of a push of an object left in place, as a share of the slip of a carried one."""

_PUSHED_SHARE = 0.01
"""Prior share of such grasps. More are pushed than that, but while an object is little known many grasps fit badly that
were not pushed.
"""


class MotionCost:
    """Negative log probability of the slips between successive poses, up to a constant."""

    def __init__(
        self,
        motions: Array,
        noise: MotionNoise,
        space: PoseVectors,
        moved: Sequence[Moved] | None = None,
        measured: Sequence[StepSigma | None] = (),
    ) -> None:
        """
        Args:
            motions: of the hand before each grasp, shape (k, size); the first is not used.
            noise: of a re-orientation.
            space: kind of the pose vectors.
            moved: how the object moved before each grasp, k of them; slips of steps in which it moved freely cost
                almost nothing, and those of pushes little. None: always with the hand.
            measured: own standard deviations of each step, k of them, where the fingertips felt it; heavy-tailed.
        """
        self._motions, self._space = motions, space
        self._stiff_beyond = STIFF_BEYOND_SIGMA if noise.gripped else np.inf
        certainty = np.ones(len(motions))
        certainty[~motions.any(axis=1)] = 1 / noise.unheld
        for step, how in enumerate(moved or ()):
            if how is not Moved.AS_MEANT:
                certainty[step] = 1 / _push_scale(noise) if how is Moved.PUSHED else _HARDLY
        self._weights = certainty[1:, None] / space.sigmas(noise)
        self._is_heavy = np.zeros(len(self._weights), dtype=bool)
        for step, own in enumerate(measured):
            if own is not None and step and (moved is None or moved[step] is Moved.AS_MEANT):
                self._weights[step - 1] = 1 / space.sigmas(noise.after(motions[step], own))
                self._is_heavy[step - 1] = True

    @classmethod
    def of(cls, contact_map: ContactMap, noise: MotionNoise) -> Self:
        """Along the trajectory of a map."""
        return cls(contact_map.motions, noise, contact_map.space, contact_map.moved, contact_map.motion_sigmas)

    def value(self, rows: Array) -> float:
        """The cost of poses of shape (k, size)."""
        return float(np.sum(self.steps(rows)))

    def steps(self, rows: Array) -> Array:
        """The cost of each step between poses of shape (k, size), shape (k - 1,)."""
        slip = self._lengths(self._scale(rows))
        return self._costs(slip, np.maximum(slip - self._stiff_beyond, 0.0))

    def value_and_gradient(self, rows: Array) -> tuple[float, Array]:
        """The cost and its derivative by each pose, shape (k, size)."""
        scaled = self._scale(rows)
        slip = self._lengths(scaled)
        excess = np.maximum(slip - self._stiff_beyond, 0.0)
        by_part = 1 + _STIFFNESS * excess / np.maximum(slip, 1e-12)
        by_part[self._is_heavy] = heavy_tailed_weight(slip[self._is_heavy] ** 2, self._parts)
        stretch = np.repeat(by_part, self._parts, axis=1)
        pull = scaled * stretch * self._weights
        later, earlier = self._space.slip_derivatives(rows, self._motions)
        gradient = np.zeros_like(rows)
        gradient[1:] += np.einsum("kij,ki->kj", later, pull)
        gradient[:-1] += np.einsum("kij,ki->kj", earlier, pull)
        return float(np.sum(self._costs(slip, excess))), gradient

    def information(self, rows: Array) -> Array:
        """Second derivative by all poses but the first, slips taken as Gaussian; shape ((k - 1) size, (k - 1) size).

        A measured step counts less, the farther it is from its expected spread.
        """
        count, size = len(rows) - 1, self._space.size
        later, earlier = self._space.slip_derivatives(rows, self._motions)
        by_rows = np.zeros((count, size, count, size))
        index = np.arange(count)
        by_rows[index, :, index] = later
        by_rows[index[1:], :, index[:-1]] = earlier[1:]
        scaled = (by_rows * self._trust(rows)[:, :, None, None]).reshape(count * size, count * size)
        return np.asarray(scaled.T @ scaled)

    def slips_in_sigma(self, rows: Array) -> Array:
        """Lengths of translation and rotation of each slip over their standard deviations, shape (k - 1, 2)."""
        return self._lengths(self._scale(rows))

    def _trust(self, rows: Array) -> Array:
        """One over the standard deviation of each component of each step, larger for measured ones that are off.

        Where they are not, it is the stated one, although their law is narrower there: a pose that nothing else tells
        has the spread of the whole law.
        """
        if not self._is_heavy.any():
            return self._weights
        trust, slip = self._weights.copy(), self._lengths(self._scale(rows))[self._is_heavy]
        weight = np.minimum(heavy_tailed_weight(slip**2, self._parts), 1.0)
        trust[self._is_heavy] *= np.repeat(np.sqrt(weight), self._parts, axis=1)
        return trust

    def _costs(self, slip: Array, excess: Array) -> Array:
        costs = 0.5 * np.sum(slip**2 + _STIFFNESS * excess**2, axis=1)
        costs[self._is_heavy] = heavy_tailed_cost(slip[self._is_heavy] ** 2, self._parts).sum(axis=1)
        return np.asarray(costs)

    def scaled_slips(self, rows: Array) -> Array:
        """Each slip over its standard deviations, shape (k - 1, size)."""
        return self._scale(rows)

    @property
    def _parts(self) -> NDArray[np.int_]:
        return np.array([self._space.translations, self._space.size - self._space.translations])

    def _scale(self, rows: Array) -> Array:
        slips = self._space.deviation(rows[1:], self._space.compose(self._motions[1:], rows[:-1]))
        return np.asarray(slips * self._weights)

    def _lengths(self, scaled: Array) -> Array:
        return np.sqrt(np.add.reduceat(scaled**2, [0, self._space.translations], axis=1))


def pushed_nats(noise: MotionNoise, space: PoseVectors) -> float:
    """The cost of a push of an object left in place, apart from its size.

    The share of such grasps, and the norm of the wider normal distribution over that of the narrower one.
    """
    return -float(np.log(_PUSHED_SHARE) + space.size * np.log(noise.unheld / _push_scale(noise)))


def _push_scale(noise: MotionNoise) -> float:
    """Size of pushes, as a share of a carried object's slips; never less than the motion of an unheld object."""
    return max(_PUSHED, noise.unheld)


def estimated_noise(contact_map: ContactMap, configured: MotionNoise) -> MotionNoise:
    """The motion noise estimated from the slips of a trajectory, with the configured one as prior.

    Steps that the fingertips measured have a noise of their own and say nothing about the others'.
    """
    cost = MotionCost.of(contact_map, configured)
    known = zip(contact_map.moved[1:], contact_map.motion_sigmas[1:], strict=True)
    bound = [how is not Moved.FREELY and measured is None for how, measured in known]
    slips = cost.slips_in_sigma(contact_map.rows)[bound]
    translations, size = contact_map.space.translations, contact_map.space.size
    freedom = np.array([translations, size - translations])
    variance = (_CONFIGURED_SLIPS + np.sum(slips**2, axis=0) / freedom) / (_CONFIGURED_SLIPS + len(slips))
    ratio = np.sqrt(variance)
    translation_m, rotation_rad = float(configured.translation_m * ratio[0]), float(configured.rotation_rad * ratio[1])
    return configured.model_copy(update={"translation_m": translation_m, "rotation_rad": rotation_rad})
