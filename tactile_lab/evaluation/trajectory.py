"""Errors of the object's trajectory relative to the marker camera.

The estimate's object frame is defined by the first grasp and independent of the frame of the object's model. One fixed
transform relates them: the one that makes both agree at the first grasp for which both are known.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from gtsam import Pose3
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.poses import rotation_angle_rad

Poses = Sequence[Pose3 | None]
"""One ``world_T_object`` per grasp; None if unknown."""


@dataclass(frozen=True)
class Compared:
    """One grasp for which the estimated and the true ``world_T_object`` are both known."""

    index: int
    estimate: Pose3
    truth: Pose3


@dataclass(frozen=True)
class GraspError:
    """Pose error at one grasp: distance of the object origins and angle between the frames."""

    mm: float
    deg: float


@dataclass(frozen=True)
class PoseErrors:
    """Errors of a whole trajectory after the first grasp's object frame is aligned.

    Attributes:
        per_grasp: error at each grasp; None if the estimate or the truth is missing.
        aligned_at: the grasp whose pose the frames were aligned at (its own error is zero).
        rmse_mm, rmse_deg: root mean square over the compared grasps without the aligned one.
        final_mm, final_deg: error at the last compared grasp.
        drift_mm_per_grasp, drift_deg_per_grasp: slope of the error over the grasps, least squares through zero
            at the aligned grasp.
        step_mm, step_deg: root mean square error of the motion from one compared grasp to the next.
    """

    per_grasp: tuple[GraspError | None, ...]
    aligned_at: int
    rmse_mm: float
    rmse_deg: float
    final_mm: float
    final_deg: float
    drift_mm_per_grasp: float
    drift_deg_per_grasp: float
    step_mm: float
    step_deg: float


def compared_grasps(estimate: Poses, truth: Poses) -> list[Compared]:
    """Grasps for which both the estimated and the true pose are known, in order."""
    both = enumerate(zip(estimate, truth, strict=True))
    return [Compared(index, pose, true) for index, (pose, true) in both if pose is not None and true is not None]


def estimate_T_truth(estimate: Poses, truth: Poses) -> Pose3 | None:
    """The transform from the truth's object frame into the estimate's, from the first grasp that has both.

    It is the ``A`` in ``aligned = world_T_object_estimate * A``; None if no grasp has both.
    """
    both = compared_grasps(estimate, truth)
    return both[0].estimate.between(both[0].truth) if both else None


def aligned_poses(estimate: Poses, truth: Poses) -> tuple[Pose3 | None, ...]:
    """The estimated poses of the truth's object frame; all None if no grasp has both."""
    alignment = estimate_T_truth(estimate, truth)
    return tuple(None if pose is None or alignment is None else pose * alignment for pose in estimate)


def pose_errors(estimate: Poses, truth: Poses) -> PoseErrors | None:
    """Errors of the estimated trajectory, or None if no grasp after the aligned one can be compared."""
    both = compared_grasps(aligned_poses(estimate, truth), truth)
    if len(both) < 2:
        return None
    found = {pair.index: _difference(pair.truth, pair.estimate) for pair in both}
    table = _table(found.values())
    rmse, final, step = (
        _rms(table[1:]),
        GraspError(*map(float, table[-1])),
        _rms(_table(map(_step_error, both, both[1:]))),
    )
    drift = _slope_through_zero(np.array([pair.index - both[0].index for pair in both]), table)
    return PoseErrors(
        per_grasp=tuple(found.get(index) for index in range(len(truth))),
        aligned_at=both[0].index,
        rmse_mm=rmse.mm,
        rmse_deg=rmse.deg,
        final_mm=final.mm,
        final_deg=final.deg,
        drift_mm_per_grasp=drift.mm,
        drift_deg_per_grasp=drift.deg,
        step_mm=step.mm,
        step_deg=step.deg,
    )


def _step_error(before: Compared, after: Compared) -> GraspError:
    return _difference(before.truth.between(after.truth), before.estimate.between(after.estimate))


def _difference(truth: Pose3, estimate: Pose3) -> GraspError:
    difference = truth.between(estimate)
    distance_m = float(np.linalg.norm(difference.translation()))
    return GraspError(mm=1e3 * distance_m, deg=float(np.degrees(rotation_angle_rad(difference))))


def _table(errors: Iterable[GraspError]) -> Array:
    return np.array([[error.mm, error.deg] for error in errors])


def _rms(table: Array) -> GraspError:
    return GraspError(*map(float, np.sqrt(np.mean(table**2, axis=0))))


def _slope_through_zero(steps: NDArray[np.int_], table: Array) -> GraspError:
    return GraspError(*map(float, steps @ table / float(steps @ steps)))
