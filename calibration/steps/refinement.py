"""Joint robust refinement in gtsam, shared by the three forearm problems.

Every observation is one factor with its own noise and a Huber loss whose threshold only outliers pass; the unknown
pose, the joints' offsets and whatever else is unknown are solved for together, and the covariance comes from the
marginals. It is scaled by the noise estimated from the residuals, so that noise above the stated one widens the region.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, TypeAlias

import gtsam
import numpy as np
from gtsam import Pose3
from scipy.stats import chi2

from drivers.core.contacts import Array

MOUNT, OFFSETS, BOARD, CAMERA, SCALE, DELAY = (gtsam.symbol(letter, 0) for letter in "xjycsd")

Evaluation: TypeAlias = Callable[[gtsam.Values], tuple[Array, list[Array]]]
"""Residual, shape (m,), and its derivatives by each key, each (m, size of the key)."""

_OUTLIER_SHARE = 0.01
_ITERATIONS = 60


@dataclass(frozen=True, eq=False)
class Measurement:
    """One observation.

    Attributes:
        keys: unknowns it depends on.
        covariance: of its residual, shape (m, m).
        evaluate: residual and derivatives.
        robust: whether it may be an outlier.
    """

    keys: tuple[int, ...]
    covariance: Array
    evaluate: Evaluation
    robust: bool = True

    def factor(self) -> Any:
        """The gtsam factor."""

        def error(this: Any, values: gtsam.Values, jacobians: Any) -> Array:
            residual, derivatives = self.evaluate(values)
            if jacobians is not None:
                for index, derivative in enumerate(derivatives):
                    jacobians[index] = derivative
            return residual

        return gtsam.CustomFactor(self._noise(), list(self.keys), error)

    def squared_distance(self, values: gtsam.Values) -> float:
        """Squared Mahalanobis length of the residual."""
        residual, _ = self.evaluate(values)
        return float(residual @ np.linalg.solve(self.covariance, residual))

    def _noise(self) -> Any:
        noise = gtsam.noiseModel.Gaussian.Covariance(self.covariance)
        if not self.robust:
            return noise
        loss = gtsam.noiseModel.mEstimator.Huber.Create(_threshold(len(self.covariance)))
        return gtsam.noiseModel.Robust.Create(loss, noise)


@dataclass(frozen=True)
class JointOffset:
    """A joint's offset, measured minus true angle, radians, with its standard deviation after and before."""

    offset_rad: float
    sigma_rad: float
    prior_rad: float

    @property
    def observable(self) -> bool:
        """Whether the data add information to the prior."""
        return self.sigma_rad < 0.5 * self.prior_rad


@dataclass(frozen=True, eq=False)
class Solution:
    """A refined solution.

    Attributes:
        world_T_mount: the pose.
        covariance: of a small motion on the mount's side, rotation first, shape (6, 6).
        offsets: joint offsets by joint.
        variance_factor: squared residuals over what the stated noise allows; about 1 when the noise is as stated.
        others: further poses that were found, by name.
        numbers: further figures that were found, by name.
        outliers: indices of observations beyond the robust threshold.
        values: all unknowns, where a solve with other data may start.
    """

    world_T_mount: Pose3
    covariance: Array
    offsets: Mapping[str, JointOffset]
    variance_factor: float
    values: gtsam.Values
    others: Mapping[str, Pose3] = field(default_factory=dict)
    numbers: Mapping[str, float] = field(default_factory=dict)
    outliers: tuple[int, ...] = ()


def prior_of_offsets(sigmas: Array) -> Measurement:
    """Prior of the offsets: one standard deviation each, shape (n,)."""

    def evaluate(values: gtsam.Values) -> tuple[Array, list[Array]]:
        return values.atVector(OFFSETS), [np.eye(len(sigmas))]

    return Measurement((OFFSETS,), np.diag(sigmas**2), evaluate, robust=False)


def minimise(measurements: Sequence[Measurement], start: gtsam.Values) -> gtsam.Values:
    """Levenberg-Marquardt over all unknowns."""
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setMaxIterations(_ITERATIONS)
    return gtsam.LevenbergMarquardtOptimizer(_graph(measurements), start, parameters).optimize()


def marginal(measurements: Sequence[Measurement], values: gtsam.Values, key: int) -> Array:
    """Covariance of one unknown with all others unknown too, gtsam's order for poses."""
    return np.asarray(gtsam.Marginals(_graph(measurements), values).marginalCovariance(key))


def variance_factor(measurements: Sequence[Measurement], values: gtsam.Values, unknowns: int) -> float:
    """Squared residuals over degrees of freedom, outliers no more than the robust loss counts them."""
    rows = sum(len(measurement.covariance) for measurement in measurements)
    total = sum(_counted_error(measurement, values) for measurement in measurements)
    return total / max(1, rows - unknowns)


def outliers(measurements: Sequence[Measurement], values: gtsam.Values) -> tuple[int, ...]:
    """Indices of the measurements beyond the robust threshold."""
    return tuple(
        index
        for index, measurement in enumerate(measurements)
        if measurement.squared_distance(values) > _threshold(len(measurement.covariance)) ** 2
    )


@lru_cache
def _threshold(size: int) -> float:
    """Mahalanobis length that one in a hundred residuals with this many numbers exceeds."""
    return float(np.sqrt(chi2.ppf(1 - _OUTLIER_SHARE, size)))


def _counted_error(measurement: Measurement, values: gtsam.Values) -> float:
    squared, size = measurement.squared_distance(values), len(measurement.covariance)
    if not measurement.robust:
        return squared
    threshold, length = _threshold(size), float(np.sqrt(squared))
    return squared if length <= threshold else 2 * threshold * length - threshold**2


def _graph(measurements: Sequence[Measurement]) -> Any:
    graph = gtsam.NonlinearFactorGraph()
    for measurement in measurements:
        graph.add(measurement.factor())
    return graph
