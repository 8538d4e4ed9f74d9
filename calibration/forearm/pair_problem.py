"""Hand-eye calibration from pairs of poses, as other programs record them: without corners, with unknown noise.

The other program took the target's printed size for granted. A print of another size scales all its distances alike,
and shifts the answer by millimetres without a visible residual; so the print's scale is an unknown, with a prior.
"""

from __future__ import annotations

from collections.abc import Sequence

import gtsam
import numpy as np
from gtsam import Pose3
from pydantic import Field
from scipy.stats import chi2

from calibration.forearm.hand_eye import solve_ax_xb, solve_ax_zb
from calibration.steps.observations import PosePair
from calibration.steps.pose_residuals import PoseResidual
from calibration.steps.refinement import (
    BOARD,
    MOUNT,
    SCALE,
    Measurement,
    Solution,
    marginal,
    minimise,
    outliers,
    variance_factor,
)
from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.core.poses import rotation_angle_rad

_MEDIAN_OF_THREE = float(chi2.median(3))
_LEAST_rad, _LEAST_m = 1e-6, 1e-6
_MOST_SIGMAS = 3.5
_GROSS = 15.0
"""Mahalanobis length of a pair that cannot be noise; the robust threshold is 4.1."""
_ROUNDS = 3
"""The noise is taken from the residuals, and the residuals follow from the noise's shares."""


class PairNoise(StrictModel):
    """What is known of the pairs beforehand.

    Attributes:
        print_scale_sigma: error of the printed target's size as a share of it, one standard deviation: 0.001 where a
            bar of 100 mm was measured to 0.1 mm. Unless given the print is not trusted.
    """

    print_scale_sigma: float = Field(default=0.03, gt=0.0, le=0.1)


class PairProblem:
    """All pairs of one calibration; the world is the camera's frame.

    Args:
        pairs: hand in the mount's frame with target in the camera's.
        known: what is known of them beforehand.
    """

    unknowns = 13

    def __init__(self, pairs: Sequence[PosePair], known: PairNoise | None = None) -> None:
        self.pairs = tuple(pairs)
        self._scale_sigma = (known or PairNoise()).print_scale_sigma
        self._prior = _prior_of_scale(self._scale_sigma)
        poses = [pair.mount_T_hand for pair in pairs], [pair.camera_T_target for pair in pairs]
        found = solve_ax_zb(*poses)
        self._closed = {"shah": found.mount_T_camera, "park_martin": solve_ax_xb(*poses).mount_T_camera}
        self._start = self.first_values()
        self._start.insert(MOUNT, found.mount_T_camera.inverse())
        self._start.insert(BOARD, found.hand_T_target)
        self._start.insert(SCALE, np.zeros(1))
        for _ in range(_ROUNDS):
            self._noise = _noise_of([Pose3.Logmap(_off(pair, self._start)) for pair in self.pairs_at(self._start)])
            measured = self._measurements(range(self.count))
            self._start = minimise(_without_gross(measured, self._start), self._start)

    @property
    def count(self) -> int:
        """Number of pairs."""
        return len(self.pairs)

    def first_values(self) -> gtsam.Values:
        """Where further unknowns start."""
        return gtsam.Values()

    def pairs_at(self, values: gtsam.Values) -> tuple[PosePair, ...]:
        """The pairs, where they depend on further unknowns."""
        return self.pairs

    def measurement(self, index: int, noise: Array) -> Measurement:
        """One pair as an observation, with the covariance of its residual, shape (6, 6)."""
        pair = self.pairs[index]
        return Measurement((MOUNT, BOARD, SCALE), noise, lambda values: evaluate_pair(pair, values))

    def further_numbers(self, measured: Sequence[Measurement], values: gtsam.Values) -> dict[str, float]:
        """What was found of further unknowns, by name."""
        return {}

    def solve(self, keep: Sequence[int] | None = None, near: Solution | None = None) -> Solution:
        """The refined solution from all pairs, or from those in ``keep``.

        Raises:
            ConfigurationError: the pairs contradict what is known of the print's size.
        """
        measured = self._measurements(range(self.count) if keep is None else keep)
        values = minimise(_without_gross(measured, self._start), near.values if near else self._start)
        measured, everything = _without_gross(measured, values), measured
        share, sigma = float(values.atVector(SCALE)[0]), float(np.sqrt(marginal(measured, values, SCALE)[0, 0]))
        _refuse_contradiction(share, sigma, self._scale_sigma)
        factor = variance_factor(measured, values, self.unknowns)
        return Solution(
            world_T_mount=values.atPose3(MOUNT),
            covariance=max(factor, 1.0) * marginal(measured, values, MOUNT),
            offsets={},
            variance_factor=factor,
            values=values,
            others={"hand_T_target": values.atPose3(BOARD)},
            numbers={
                "print_larger_share": share,
                "print_larger_sigma": sigma,
                **self.further_numbers(measured, values),
                **self._beside(values),
            },
            outliers=tuple(index for index in outliers(everything, values) if index < len(everything) - 1),
        )

    def _beside(self, values: gtsam.Values) -> dict[str, float]:
        """How far the closed forms' answers, which trust the print, are from the refined one: millimetres, degrees."""
        refined = values.atPose3(MOUNT).inverse()
        offs = {name: refined.between(found) for name, found in self._closed.items()}
        away = {f"{name}_mm_away": 1e3 * float(np.linalg.norm(off.translation())) for name, off in offs.items()}
        return away | {f"{name}_deg_away": float(np.degrees(rotation_angle_rad(off))) for name, off in offs.items()}

    def _measurements(self, chosen: Sequence[int]) -> list[Measurement]:
        return [*(self.measurement(index, self._noise) for index in chosen), self._prior]

    def residuals(self, solution: Solution) -> tuple[PoseResidual, ...]:
        """Residual of each pair."""
        offs = [_off(pair, solution.values) for pair in self.pairs_at(solution.values)]
        return tuple(
            PoseResidual(f"pair {index + 1}", float(np.linalg.norm(off.translation())), rotation_angle_rad(off))
            for index, off in enumerate(offs)
        )


def _noise_of(offs: Sequence[Array]) -> Array:
    """Covariance of one pair, shape (6, 6), from the medians of the closed form's residuals: outliers do not count."""
    squared = np.square(np.array(offs))
    turns, shifts = (np.median(squared[:, part].sum(axis=1)) for part in (slice(0, 3), slice(3, 6)))
    variances = [max(turns / _MEDIAN_OF_THREE, _LEAST_rad**2), max(shifts / _MEDIAN_OF_THREE, _LEAST_m**2)]
    return np.diag(np.repeat(variances, 3))


def _off(pair: PosePair, values: gtsam.Values) -> Pose3:
    """The target as the camera sees it, in the target's frame as the hand carries it."""
    carried = values.atPose3(MOUNT) * pair.mount_T_hand * values.atPose3(BOARD)
    return carried.between(_seen(pair, values))


def _seen(pair: PosePair, values: gtsam.Values) -> Pose3:
    """The target where it really is, if the print is larger than the other program took it for."""
    larger = 1.0 + float(values.atVector(SCALE)[0])
    return Pose3(pair.camera_T_target.rotation(), larger * pair.camera_T_target.translation())


def _without_gross(measured: Sequence[Measurement], values: gtsam.Values) -> list[Measurement]:
    """Without pairs far beyond the robust threshold: the print's scale would follow even their bounded weight."""
    return [each for each in measured if not each.robust or each.squared_distance(values) < _GROSS**2]


def _refuse_contradiction(share: float, sigma: float, prior_sigma: float) -> None:
    """A scale that data and prior do not agree on, by three standard deviations of what lies between them."""
    between = share / max(1.0 - (sigma / prior_sigma) ** 2, 1e-9)  # what the data alone say
    if abs(share) > _MOST_SIGMAS * np.sqrt(max(prior_sigma**2 - sigma**2, 0.0)):
        what = f"the pairs say that the print is {100 * between:+.2f} % larger than the other program took it for"
        what += f", but it is stated to be known to {100 * prior_sigma:g} %"
        raise ConfigurationError(what, where="pairs", hint="Measure the printed target, then record the pairs again")


def _prior_of_scale(sigma: float) -> Measurement:
    def evaluate(values: gtsam.Values) -> tuple[Array, list[Array]]:
        return values.atVector(SCALE), [np.eye(1)]

    return Measurement((SCALE,), np.array([[sigma**2]]), evaluate, robust=False)


def evaluate_pair(pair: PosePair, values: gtsam.Values) -> tuple[Array, list[Array]]:
    """Residual of a pair, shape (6,), and its derivatives by mount, board and scale."""
    off = _off(pair, values)
    turned = Pose3.LogmapDerivative(off)
    slope = -turned @ off.inverse().AdjointMap()
    by_mount = slope @ (pair.mount_T_hand * values.atPose3(BOARD)).inverse().AdjointMap()
    by_scale = turned[:, 3:] @ pair.camera_T_target.rotation().unrotate(pair.camera_T_target.translation())
    return Pose3.Logmap(off), [by_mount, slope, by_scale[:, None]]
