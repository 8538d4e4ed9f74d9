"""Registration error: how well the contacts of all grasps fit together in the object's frame.

It measures the tracking alone, without any shape model: contacts are placed in the object frame once
with the estimated and once with the true poses, and compared after one best rigid fit.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array
from drivers.core.poses import transform_points
from tactile_lab.evaluation.trajectory import Poses, compared_grasps

FAILURE_LIMIT_MM = 5.0
"""A run whose registration error is above this limit counts as failed."""


def registration_verdict(error_mm: float, symmetry_turns: int | None) -> tuple[bool, str]:
    """Whether a run passes, and the verdict as text.

    Args:
        error_mm: its registration error.
        symmetry_turns: see :func:`tactile_lab.evaluation.truth.rotational_symmetry.symmetry_turns`.
    """
    without = "" if symmetry_turns is None else ", ignoring rotations about its axis of symmetry"
    passed = error_mm <= FAILURE_LIMIT_MM
    return passed, f"{'passed: at most' if passed else 'failed: above'} {FAILURE_LIMIT_MM:g} mm{without}"


def registration_rms_mm(
    contacts_world_m: Sequence[Array], estimate: Poses, truth: Poses, dimension: int
) -> float | None:
    """RMS distance between contacts placed with estimated and with true poses, after one best rigid fit.

    Args:
        contacts_world_m: contact points of each grasp, shape (n, 3), world frame.
        estimate: estimated ``world_T_object`` of each grasp.
        truth: true ``world_T_object`` of each grasp.
        dimension: 2 compares in the table plane only, 3 in space.

    Returns:
        Millimetres, or None if fewer than two grasps with contacts have both poses.
    """
    used = [pair for pair in compared_grasps(estimate, truth) if len(contacts_world_m[pair.index])]
    if len(used) < 2:
        return None
    placed = in_object_m((contacts_world_m[pair.index], pair.estimate) for pair in used)[:, :dimension]
    true = in_object_m((contacts_world_m[pair.index], pair.truth) for pair in used)[:, :dimension]
    residuals = _rigid_fit(placed, true) - true
    return 1e3 * float(np.sqrt(np.mean(np.sum(residuals**2, axis=1))))


def in_object_m(grasps: Iterable[tuple[Array, Pose3]]) -> Array:
    """Contact points of grasps, shape (n, 3) each in the world frame, in the frame of an object at its pose at each
    grasp, shape (m, 3).
    """
    return np.vstack([np.empty((0, 3)), *(transform_points(pose.inverse(), points) for points, pose in grasps)])


def _rigid_fit(source: Array, target: Array) -> Array:
    """``source`` moved rigidly onto ``target`` by least squares (Kabsch), no reflection."""
    source_centre, target_centre = source.mean(axis=0), target.mean(axis=0)
    left, _, right = np.linalg.svd((source - source_centre).T @ (target - target_centre))
    mirror = np.ones(source.shape[1])
    mirror[-1] = np.sign(np.linalg.det(left @ right))
    return np.asarray((source - source_centre) @ (left * mirror) @ right + target_centre)
