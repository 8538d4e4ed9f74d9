"""Edges of a planar pose graph: relative poses between nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array
from drivers.core.poses import wrap_angle_rad
from tactile_lab.slam.tracking.contacts.motion import compose, inverse


@dataclass(frozen=True)
class RelativePose:
    """A measured ``start_T_end`` between two nodes.

    Attributes:
        start, end: numbers of the nodes.
        pose: (x_m, y_m, yaw_rad) of the end seen from the start, shape (3,).
        covariance: of a small motion after it, (x, y, yaw) in the end's axes (gtsam's order), shape (3, 3).
    """

    start: int
    end: int
    pose: Array
    covariance: Array


def chain(odometry: Sequence[RelativePose], first: Array) -> Array:
    """Poses of all nodes, shape (n + 1, 3): the first one, and each next one seen from its predecessor."""
    rows = [np.asarray(first, dtype=float)]
    for edge in odometry:
        rows.append(compose(rows[-1], edge.pose))
    return np.array(rows)


def residuals(rows: Array, edges: Sequence[RelativePose]) -> Array:
    """Gaps between edges and poses: the measured end's pose seen from the estimated end, shape (m, 3)."""
    if not edges:
        return np.zeros((0, 3))
    starts, ends = rows[[edge.start for edge in edges]], rows[[edge.end for edge in edges]]
    gaps = compose(inverse(ends), compose(starts, np.array([edge.pose for edge in edges])))
    gaps[:, 2] = wrap_angle_rad(gaps[:, 2])
    return gaps


def jacobians(rows: Array, edges: Sequence[RelativePose]) -> tuple[Array, Array]:
    """Derivatives of :func:`residuals` by small motions of start and end in their own axes, (m, 3, 3) each."""
    starts = np.array([edge.start for edge in edges], dtype=np.intp)
    ends = np.array([edge.end for edge in edges], dtype=np.intp)
    seen = compose(inverse(rows[ends]), rows[starts])  # end_T_start
    arms = np.array([edge.pose[:2] for edge in edges]).reshape(-1, 2)
    cosine, sine = np.cos(seen[:, 2]), np.sin(seen[:, 2])
    by_start = np.zeros((len(edges), 3, 3))
    by_start[:, 0, 0], by_start[:, 0, 1] = cosine, -sine
    by_start[:, 1, 0], by_start[:, 1, 1] = sine, cosine
    by_start[:, 0, 2] = -sine * arms[:, 0] - cosine * arms[:, 1]
    by_start[:, 1, 2] = cosine * arms[:, 0] - sine * arms[:, 1]
    by_start[:, 2, 2] = 1.0
    gaps = residuals(rows, edges)
    by_end = np.tile(-np.eye(3), (len(edges), 1, 1))
    by_end[:, 0, 2], by_end[:, 1, 2] = gaps[:, 1], -gaps[:, 0]
    return by_start, by_end
