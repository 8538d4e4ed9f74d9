"""Checks loops against the truth: how many of those in the pose graph were wrong associations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gtsam import Pose2, Pose3

from drivers.core.poses import planar
from tactile_lab.evaluation.trajectory import Poses, estimate_T_truth

WRONG_DISTANCE_m = 0.010
WRONG_ANGLE_rad = np.radians(10.0)
"""A loop with a larger error is not noise (about 1 mm and 2 degrees) but another face."""


def first_in_map(estimate: Poses) -> int:
    """The grasp that defined the object frame: number 0 of the pose graph."""
    return next((index for index, pose in enumerate(estimate) if pose is not None), 0)


def wrong_loops(loops: Sequence[Mapping[str, Any]], estimate: Poses, truth: Poses) -> int | None:
    """How many accepted loops contradict the truth; None if one of them cannot be checked.

    Args:
        loops: as in ``slam.json``: grasps in the graph, verdict, relative pose and displacement (3 x 3 each).
        estimate: estimated poses of all grasps; they define the object frame of the loops.
        truth: true poses of all grasps.
    """
    alignment, offset = estimate_T_truth(estimate, truth), first_in_map(estimate)
    if alignment is None:
        return None
    known = [None if pose is None else pose * alignment.inverse() for pose in truth]
    checked = [_is_wrong(loop, known[offset:]) for loop in loops if loop["accepted"]]
    return None if None in checked else sum(bool(wrong) for wrong in checked)


def _is_wrong(loop: Mapping[str, Any], truth: Sequence[Pose3 | None]) -> bool | None:
    earlier, later = truth[loop["earlier"]], truth[loop["later"]]
    if earlier is None or later is None:
        return None
    if loop.get("displacement") is not None:
        distance_m, angle_rad = _displacement_error(_pose(loop["displacement"]), planar(earlier), planar(later))
    else:
        off = _pose(loop["earlier_T_later"]).between(planar(earlier.between(later)))
        distance_m, angle_rad = float(np.hypot(off.x(), off.y())), abs(off.theta())
    return distance_m > WRONG_DISTANCE_m or angle_rad > WRONG_ANGLE_rad


def _displacement_error(displacement: Pose2, earlier: Pose2, later: Pose2) -> tuple[float, float]:
    """Error of a displacement relative to the object's true motion; needs no object frame."""
    off = displacement.compose(later).between(earlier)
    return float(np.hypot(off.x(), off.y())), abs(off.theta())


def _pose(matrix: Sequence[Sequence[float]]) -> Pose2:
    return Pose2(matrix[0][2], matrix[1][2], float(np.arctan2(matrix[1][0], matrix[0][0])))
