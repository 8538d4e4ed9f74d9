"""Finds consistent sets of loops from headings alone, to initialize the robust graph without trusting odometry.

A wrong association turns the object (by 90 or 180 degrees on a box), and after a few steps of 20 degrees odometry
cannot detect this. So loops are added one by one, the most predictable first, and each is assumed right (possibly with
a full turn more than odometry says) or as wrong. The likeliest combinations are kept. Headings are linear, so a
combination is a Gaussian, and a loop is one rank-one update of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.poses import wrap_angle_rad
from tactile_lab.slam.graph.relative_poses import RelativePose

FULL_TURNS_rad = 2 * np.pi * np.array([-1.0, 0.0, 1.0])


@dataclass(frozen=True)
class HeadingHypotheses:
    """Combinations of loops, the likeliest first.

    Attributes:
        headings_rad: shape (h, n), of n nodes, not wrapped.
        accepted: shape (h, m), which of m loops are right.
        costs: negative log probability, shape (h,).
    """

    headings_rad: Array
    accepted: NDArray[np.bool_]
    costs: Array


@dataclass(frozen=True)
class _Beam:
    means: Array
    covariances: Array
    accepted: NDArray[np.bool_]
    costs: Array


def heading_hypotheses(
    odometry: Sequence[RelativePose], loops: Sequence[RelativePose], *, wrong_share: float, kept: int
) -> HeadingHypotheses:
    """Find the likeliest combinations of right loops.

    Args:
        odometry: from each node to the next, node 0 first; node 0 has heading 0.
        loops: relative poses between any two nodes.
        wrong_share: expected share of wrong loops; a wrong loop may turn to anywhere.
        kept: number of combinations carried along.
    """
    ends = np.array([[loop.start, loop.end] for loop in loops], dtype=np.intp).reshape(-1, 2)
    turns = np.array([loop.pose[2] for loop in loops])
    variances = np.array([loop.covariance[2, 2] for loop in loops])
    refused_cost = np.log(2 * np.pi) - np.log(wrong_share)
    beam = _start(odometry, len(loops))
    open_loops = np.arange(len(loops))
    while len(open_loops):
        spreads = _spread(beam.covariances[0], ends[open_loops])
        first = int(np.argmin(spreads + variances[open_loops]))
        loop, open_loops = int(open_loops[first]), np.delete(open_loops, first)
        beam = _branch(
            beam, loop, ends[loop], float(turns[loop]), float(variances[loop]), refused_cost, wrong_share, kept
        )
    return HeadingHypotheses(beam.means, beam.accepted, beam.costs)


def _start(odometry: Sequence[RelativePose], loops: int) -> _Beam:
    steps = np.array([edge.pose[2] for edge in odometry])
    gathered = np.concatenate([[0.0], np.cumsum([edge.covariance[2, 2] for edge in odometry])])
    return _Beam(
        means=np.concatenate([[0.0], np.cumsum(steps)])[None],
        covariances=np.minimum(gathered[:, None], gathered)[None],
        accepted=np.zeros((1, loops), dtype=bool),
        costs=np.zeros(1),
    )


def _spread(covariance: Array, ends: NDArray[np.intp]) -> Array:
    """Variance of the turn between each pair of nodes."""
    start, end = ends[..., 0], ends[..., 1]
    return np.asarray(covariance[start, start] + covariance[end, end] - 2 * covariance[start, end])


def _branch(
    beam: _Beam,
    loop: int,
    ends: NDArray[np.intp],
    turn_rad: float,
    variance: float,
    refused_cost: float,
    wrong_share: float,
    kept: int,
) -> _Beam:
    """Every combination with the loop (plain, or with a full turn more or less) and without; the likeliest of them."""
    start, end = ends
    gains = beam.covariances[:, :, end] - beam.covariances[:, :, start]
    spread = gains[:, end] - gains[:, start] + variance
    plain = wrap_angle_rad(turn_rad - (beam.means[:, end] - beam.means[:, start]))
    gaps = plain[:, None] + FULL_TURNS_rad
    with_loop = 0.5 * (gaps**2 / spread[:, None] + np.log(2 * np.pi * spread[:, None])) - np.log(1 - wrong_share)
    costs = beam.costs[:, None] + np.column_stack([with_loop, np.full(len(gaps), refused_cost)])
    chosen = np.argsort(costs, axis=None, kind="stable")[:kept]
    parents, branches = np.unravel_index(chosen, costs.shape)
    taken = branches < len(FULL_TURNS_rad)
    gap = np.where(taken, gaps[parents, np.minimum(branches, len(FULL_TURNS_rad) - 1)], 0.0)
    share = gains[parents] / spread[parents, None] * taken[:, None]
    accepted = beam.accepted[parents]
    accepted[:, loop] = taken
    return _Beam(
        means=beam.means[parents] + share * gap[:, None],
        covariances=beam.covariances[parents] - share[:, :, None] * gains[parents, None, :],
        accepted=accepted,
        costs=costs[parents, branches],
    )
