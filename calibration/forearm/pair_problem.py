"""Hand-eye calibration from pairs of poses, as other programs record them: without corners, with unknown noise."""

from __future__ import annotations

from collections.abc import Sequence

import gtsam
import numpy as np
from gtsam import Pose3
from scipy.stats import chi2

from calibration.forearm.hand_eye import solve_ax_zb
from calibration.steps.observations import PosePair
from calibration.steps.pose_residuals import PoseResidual
from calibration.steps.refinement import (
    BOARD,
    MOUNT,
    Measurement,
    Solution,
    marginal,
    minimise,
    outliers,
    variance_factor,
)
from drivers.core.contacts import Array
from drivers.core.poses import rotation_angle_rad

_UNKNOWNS = 12
_MEDIAN_OF_THREE = float(chi2.median(3))
_LEAST_rad, _LEAST_m = 1e-6, 1e-6


class PairProblem:
    """All pairs of one calibration; the world is the camera's frame.

    Args:
        pairs: hand in the mount's frame with target in the camera's.
    """

    def __init__(self, pairs: Sequence[PosePair]) -> None:
        self.pairs = tuple(pairs)
        found = solve_ax_zb([pair.mount_T_hand for pair in pairs], [pair.camera_T_target for pair in pairs])
        self._start = gtsam.Values()
        self._start.insert(MOUNT, found.mount_T_camera.inverse())
        self._start.insert(BOARD, found.hand_T_target)
        self._noise = _noise_of([Pose3.Logmap(_off(pair, self._start)) for pair in pairs])

    @property
    def count(self) -> int:
        """Number of pairs."""
        return len(self.pairs)

    def solve(self, keep: Sequence[int] | None = None, near: Solution | None = None) -> Solution:
        """The refined solution from all pairs, or from those in ``keep``."""
        chosen = range(self.count) if keep is None else keep
        measured = [_measurement(self.pairs[index], self._noise) for index in chosen]
        values = minimise(measured, near.values if near else self._start)
        factor = variance_factor(measured, values, _UNKNOWNS)
        return Solution(
            world_T_mount=values.atPose3(MOUNT),
            covariance=factor * marginal(measured, values, MOUNT),
            offsets={},
            variance_factor=factor,
            values=values,
            others={"hand_T_target": values.atPose3(BOARD)},
            outliers=outliers(measured, values),
        )

    def residuals(self, solution: Solution) -> tuple[PoseResidual, ...]:
        """Residual of each pair."""
        offs = [_off(pair, solution.values) for pair in self.pairs]
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
    return carried.between(pair.camera_T_target)


def _measurement(pair: PosePair, noise: Array) -> Measurement:
    def evaluate(values: gtsam.Values) -> tuple[Array, list[Array]]:
        off = _off(pair, values)
        residual = Pose3.Logmap(off)
        slope = -Pose3.LogmapDerivative(off) @ off.inverse().AdjointMap()
        by_mount = slope @ (pair.mount_T_hand * values.atPose3(BOARD)).inverse().AdjointMap()
        return residual, [by_mount, slope]

    return Measurement((MOUNT, BOARD), noise, evaluate)
