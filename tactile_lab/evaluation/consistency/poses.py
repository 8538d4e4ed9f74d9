"""Whether the covariances of a trajectory are true, by the normalised squared error of its poses (NEES).

It follows chi square with as many degrees of freedom as a pose has estimated components. An estimate is compared with
the truth in one object frame: where it was born, at the first grasp (:func:`birth_frame`), or the one that agrees best
with all grasps (:func:`common_frame`), which does not count an error of the first grasp against all others. Of a round
object only the place of its axis is judged: how it is turned no contact can tell, and no error of it is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.contacts import Array
from drivers.core.rotations import exponential, logarithm
from tactile_lab.evaluation.consistency.levels import LEVELS
from tactile_lab.evaluation.consistency.pose_covariance import pose_deviation
from tactile_lab.evaluation.trajectory import Compared, Poses, compared_grasps
from tactile_lab.slam.graph.chances import chi_squared_quantile

_LEAST_VARIANCE = 1e-9
"""A component with a smaller variance is given, not estimated: the birth pose, or the height of what is on a table."""
_MEAN_STEPS = 10


@dataclass(frozen=True)
class PoseConsistency:
    """Stated pose uncertainties against the truth.

    Attributes:
        nees: normalised squared error of each judged pose, divided by its number of components: 1 on average if the
            covariances are true, above 1 if they are too small.
        components: estimated components of a pose: 3 on a table, 2 of a round object there, 6 in space.
        inside: share of the poses whose truth lies inside the stated region, for each of
            :data:`~tactile_lab.evaluation.consistency.levels.LEVELS`.
        log_score: mean log density of the true pose, metres and radians; higher is better.
    """

    nees: tuple[float, ...]
    components: int
    inside: tuple[float, ...]
    log_score: float


def pose_consistency(
    estimate: Poses,
    covariances: Sequence[Array | None],
    truth: Poses,
    estimate_T_truth: Pose3 | None,
    axis_m: Array | None = None,
) -> PoseConsistency | None:
    """Judge the covariances of a trajectory, relative to an object frame in which estimate and truth are compared.

    Args:
        estimate: estimated ``world_T_object`` of each grasp.
        covariances: of each, shape (6, 6), see :class:`tactile_lab.evaluation.files.trajectory_file.Trajectory`.
        truth: true poses, in the truth's object frame.
        estimate_T_truth: the truth's object frame in the estimate's: :func:`birth_frame` or :func:`common_frame`.
        axis_m: where the vertical axis of a round object is in the truth's object frame, shape (2,); None of others.

    Returns:
        None without such a frame, or if no grasp has a covariance and both poses.
    """
    if estimate_T_truth is None or not covariances:
        return None
    judged = [
        scored
        for pair in compared_grasps(estimate, truth)
        if (scored := _score(pair, covariances[pair.index], estimate_T_truth, axis_m)) is not None
    ]
    if not judged:
        return None
    nees, sizes, densities = (np.array(column) for column in zip(*judged, strict=True))
    limits = ([chi_squared_quantile(level, int(size)) for size in sizes] for level in LEVELS)
    inside = tuple(float(np.mean(nees <= np.array(most))) for most in limits)
    return PoseConsistency(tuple((nees / sizes).tolist()), int(sizes.max()), inside, float(densities.mean()))


def _score(
    pair: Compared, covariance: Array | None, estimate_T_truth: Pose3, axis_m: Array | None
) -> tuple[float, int, float] | None:
    """Squared normalised error, its number of components, and log density; None for a pose that was given."""
    if covariance is None:
        return None
    truth = pair.truth * estimate_T_truth.inverse()
    error = pose_deviation(pair.estimate, truth)
    if axis_m is not None:
        kept = _of_axis(pair.truth.transformFrom(np.append(axis_m, 0.0)) - truth.translation())
        error, covariance = kept @ error, kept @ covariance @ kept.T
    known = np.flatnonzero(np.diag(covariance) > _LEAST_VARIANCE)
    if not len(known):
        return None
    error, stated = error[known], covariance[np.ix_(known, known)]
    sign, log_determinant = np.linalg.slogdet(stated)
    if sign <= 0:
        return None
    squared = float(error @ np.linalg.solve(stated, error))
    return squared, len(known), -0.5 * (squared + float(log_determinant) + len(known) * float(np.log(2 * np.pi)))


def _of_axis(arm_m: Array) -> Array:
    """By a small motion in the world, that of a vertical axis, shape (5, 6): of a point on it, and its tilts.

    Args:
        arm_m: from the object's origin to that point, shape (3,).
    """
    kept = np.zeros((5, 6))
    kept[:3, :3], kept[:3, 3:] = np.eye(3), np.cross(np.eye(3), arm_m).T
    kept[3, 3] = kept[4, 4] = 1.0
    return kept


def birth_frame(estimate: Poses, truth: Poses) -> Pose3 | None:
    """The truth's object frame in the estimate's by the grasp that defined the latter; None if its truth is unknown."""
    both, born = compared_grasps(estimate, truth), next((i for i, pose in enumerate(estimate) if pose is not None), -1)
    return both[0].estimate.between(both[0].truth) if both and both[0].index == born else None


def common_frame(estimate: Poses, truth: Poses) -> Pose3 | None:
    """The truth's object frame in the estimate's that agrees best with all grasps (their mean); or None."""
    found = [pair.estimate.between(pair.truth) for pair in compared_grasps(estimate, truth)]
    if len(found) < 2:
        return None
    rotations = np.array([pose.rotation().matrix() for pose in found])
    mean = rotations[0]
    for _ in range(_MEAN_STEPS):
        mean = mean @ exponential(logarithm(mean.T @ rotations).mean(axis=0))
    return Pose3(Rot3(mean), np.mean([pose.translation() for pose in found], axis=0))
