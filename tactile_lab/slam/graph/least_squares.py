"""Planar pose graphs with known edges: all poses by least squares (thesis eq. 3.19 to 3.25), and their covariance."""

from __future__ import annotations

from collections.abc import Sequence

import gtsam
import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.graph.relative_poses import RelativePose, jacobians, residuals
from tactile_lab.slam.tracking.contacts.motion import pose_vector, vector_pose

_ANCHOR_SIGMAS = np.full(3, 1e-6)


def solve(
    odometry: Sequence[RelativePose],
    loops: Sequence[RelativePose],
    start: Array,
    *,
    robust_scale: float | None = None,
) -> Array:
    """Minimise (3.20) over all poses by Levenberg-Marquardt; the first one stays.

    Args:
        odometry: edges with a quadratic cost.
        loops: edges with a quadratic cost, or a redescending one (Geman-McClure).
        start: poses to start from, shape (n, 3).
        robust_scale: whitened error at which a loop's weight has fallen to a quarter; None for the quadratic cost.
    """
    graph, values = gtsam_problem(odometry, loops, start, robust_scale)
    found = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    return np.array([pose_vector(found.atPose2(index)) for index in range(len(start))])


def gtsam_problem(
    odometry: Sequence[RelativePose], loops: Sequence[RelativePose], rows: Array, robust_scale: float | None
) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    """The graph and the values to start from; parameters as for :func:`solve`."""
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    anchor = gtsam.noiseModel.Diagonal.Sigmas(_ANCHOR_SIGMAS)
    graph.add(gtsam.PriorFactorPose2(0, vector_pose(rows[0]), anchor))
    for index, row in enumerate(rows):
        values.insert(index, vector_pose(row))
    for edge in odometry:
        graph.add(_factor(edge, gtsam.noiseModel.Gaussian.Covariance(edge.covariance)))
    for edge in loops:
        noise: gtsam.noiseModel.Base = gtsam.noiseModel.Gaussian.Covariance(edge.covariance)
        if robust_scale is not None:
            noise = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.GemanMcClure.Create(robust_scale), noise)
        graph.add(_factor(edge, noise))
    return graph, values


def _factor(edge: RelativePose, noise: gtsam.noiseModel.Base) -> gtsam.BetweenFactorPose2:
    return gtsam.BetweenFactorPose2(edge.start, edge.end, vector_pose(edge.pose), noise)


def squared_distances(rows: Array, edges: Sequence[RelativePose]) -> Array:
    """Squared Mahalanobis distance of each edge from the poses, shape (m,)."""
    gaps = residuals(rows, edges)
    covariances = np.array([edge.covariance for edge in edges]).reshape(-1, 3, 3)
    return np.asarray(np.einsum("mi,mi->m", gaps, np.linalg.solve(covariances, gaps[..., None])[..., 0]))


def covariance_of(rows: Array, edges: Sequence[RelativePose]) -> Array:
    """Joint covariance of all poses, each in its own axes, the first one fixed, shape (3 n, 3 n)."""
    size = 3 * len(rows)
    information = np.zeros((size, size))
    by_start, by_end = jacobians(rows, edges)
    weights = np.linalg.inv(np.array([edge.covariance for edge in edges]))
    starts = np.array([edge.start for edge in edges])
    ends = np.array([edge.end for edge in edges])
    for one, left in ((starts, by_start), (ends, by_end)):
        for other, right in ((starts, by_start), (ends, by_end)):
            blocks = left.transpose(0, 2, 1) @ weights @ right
            at = (3 * one[:, None] + np.arange(3))[:, :, None], (3 * other[:, None] + np.arange(3))[:, None, :]
            np.add.at(information, at, blocks)
    joint = np.zeros((size, size))
    joint[3:, 3:] = np.linalg.inv(information[3:, 3:])
    return joint
