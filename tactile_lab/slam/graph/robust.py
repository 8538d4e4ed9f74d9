"""Robust solution of a planar pose graph with wrong loops.

The hand carries the object by 20 degrees at a time with an uncertainty of as much, so odometry is no useful
initialization, and a wrong association (another side of a box) fits as well as a right one until others contradict it.
The solver

1. finds the likeliest combinations of right loops from headings alone (:mod:`heading_hypotheses`),
2. solves each for all poses (eq. 3.19 to 3.25, Levenberg-Marquardt),
3. tests every loop against all others: the loops in the graph by leaving each out, those outside by their gap;
   accepts and rejects, and solves again until nothing changes,
4. keeps the combination that explains most at least cost.

Graphs too large for step 1 start from odometry, with a redescending cost on loops that is tightened step by step;
steps 3 and 4 follow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import gtsam
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from tactile_lab.slam.graph.chances import chi_squared_quantile
from tactile_lab.slam.graph.heading_hypotheses import heading_hypotheses
from tactile_lab.slam.graph.least_squares import covariance_of, gtsam_problem, solve, squared_distances
from tactile_lab.slam.graph.relative_poses import RelativePose, chain, jacobians, residuals

Mask = NDArray[np.bool_]

_TIGHTENING = (100.0, 30.0, 10.0, 3.0)
"""Whitened errors at which a loop's weight has fallen to a quarter, from start to end."""


class RobustSettings(StrictModel):
    """Parameters of the robust graph.

    Attributes:
        wrong_share: share of loops expected to be wrong.
        hypotheses: number of combinations of loops kept.
        refined: number of them that are solved for all poses.
        confidence: loops are refused above this quantile of the chi-square distribution of their test value.
        wrong_spread_m: a wrong loop may put the object anywhere within a square of this side; a loop must be more
            likely than that.
        rounds: largest number of repetitions of testing and solving.
        most_nodes: graphs with more nodes start from odometry.
    """

    wrong_share: float = Field(default=0.2, gt=0, lt=1)
    hypotheses: int = Field(default=16, ge=1)
    refined: int = Field(default=2, ge=1)
    confidence: float = Field(default=0.999, gt=0, lt=1)
    wrong_spread_m: float = Field(default=0.2, gt=0)
    rounds: int = Field(default=6, ge=1)
    most_nodes: int = Field(default=200, ge=2)


@dataclass(frozen=True)
class LoopVerdict:
    """The verdict on a loop.

    Attributes:
        accepted: whether it is part of the solution.
        test_value: its squared Mahalanobis distance from what all other accepted edges say.
        limit: its limit.
        reason: the verdict as text.
    """

    accepted: bool
    test_value: float
    limit: float
    reason: str


@dataclass(frozen=True)
class RobustSolution:
    """Solved poses.

    Attributes:
        rows: poses of all nodes (x_m, y_m, yaw_rad), shape (n, 3).
        covariances: of each pose relative to the first, (x, y, yaw) in its own axes, shape (n, 3, 3).
        verdicts: one for each loop, in the order given.
        cost: squared whitened residuals of all edges accepted, plus the limit for each loop refused.
    """

    rows: Array
    covariances: Array
    verdicts: tuple[LoopVerdict, ...]
    cost: float

    @property
    def accepted(self) -> Mask:
        """Which loops are part of the solution, shape (m,)."""
        return np.array([verdict.accepted for verdict in self.verdicts], dtype=bool)


def solve_robustly(
    odometry: Sequence[RelativePose],
    loops: Sequence[RelativePose],
    settings: RobustSettings | None = None,
    first: Array | None = None,
) -> RobustSolution:
    """Solve for all poses and separate right loops from wrong ones.

    Args:
        odometry: edge k leads from node k to node k + 1.
        loops: edges between any two nodes, some of them wrong.
        settings: see there.
        first: pose of node 0, which is fixed; the identity if not given.
    """
    settings = settings or RobustSettings()
    problem = _Problem(odometry, loops, settings, np.zeros(3) if first is None else first)
    solutions = [problem.refine(rows, accepted) for rows, accepted in problem.starts()]
    best = min(solutions, key=lambda solution: solution.cost)
    return problem.explain(best)


@dataclass(frozen=True)
class _State:
    rows: Array
    accepted: Mask
    cost: float


class _Problem:
    def __init__(
        self, odometry: Sequence[RelativePose], loops: Sequence[RelativePose], settings: RobustSettings, first: Array
    ) -> None:
        self.odometry, self.loops, self.settings, self.first = odometry, loops, settings, first
        self.limit = chi_squared_quantile(settings.confidence, 3)
        self.noises = np.array([loop.covariance for loop in loops]).reshape(-1, 3, 3)
        self.large = len(odometry) + 1 > settings.most_nodes

    def starts(self) -> list[tuple[Array, Mask]]:
        """Poses and accepted loops to start from."""
        if self.large:
            rows = self._tighten()
            return [(rows, self._admissible(rows, np.ones(len(self.loops), dtype=bool)))]
        found = heading_hypotheses(
            self.odometry, self.loops, wrong_share=self.settings.wrong_share, kept=self.settings.hypotheses
        )
        count = self.settings.refined
        return [
            (self._place(headings, accepted), accepted)
            for headings, accepted in zip(found.headings_rad[:count], found.accepted[:count], strict=True)
        ]

    def _tighten(self) -> Array:
        """Start from odometry, reducing the weight of distant loops step by step."""
        rows = chain(self.odometry, self.first)
        for scale in _TIGHTENING:
            rows = solve(self.odometry, self.loops, rows, robust_scale=scale)
        return rows

    def _place(self, headings_rad: Array, accepted: Mask) -> Array:
        """Positions by linear least squares, headings being known."""
        edges = [*self.odometry, *self._take(accepted)]
        headings = headings_rad + self.first[2]
        starts = np.array([edge.start for edge in edges])
        ends = np.array([edge.end for edge in edges])
        arms = np.array([edge.pose[:2] for edge in edges])
        weights = 1 / np.array([np.trace(edge.covariance[:2, :2]) for edge in edges])
        cosine, sine = np.cos(headings[starts]), np.sin(headings[starts])
        ways = np.column_stack([cosine * arms[:, 0] - sine * arms[:, 1], sine * arms[:, 0] + cosine * arms[:, 1]])
        count = len(headings)
        incidence = np.zeros((len(edges), count))
        incidence[np.arange(len(edges)), starts] -= 1
        incidence[np.arange(len(edges)), ends] += 1
        free = incidence[:, 1:]
        places = np.linalg.solve(free.T @ (weights[:, None] * free), free.T @ (weights[:, None] * ways))
        return np.column_stack([np.vstack([np.zeros(2), places]) + self.first[:2], headings])

    def refine(self, rows: Array, accepted: Mask) -> _State:
        """Solve, test, accept and reject until nothing changes."""
        for _ in range(self.settings.rounds):
            rows = self._solve(rows, accepted)
            tested = self._admissible(rows, accepted)
            if np.array_equal(tested, accepted):
                break
            accepted = tested
        return _State(rows, accepted, self._cost(rows, accepted))

    def _take(self, accepted: Mask) -> list[RelativePose]:
        return [loop for loop, taken in zip(self.loops, accepted, strict=True) if taken]

    def _solve(self, rows: Array, accepted: Mask) -> Array:
        return solve(self.odometry, self._take(accepted), rows)

    def _cost(self, rows: Array, accepted: Mask) -> float:
        taken = [*self.odometry, *self._take(accepted)]
        return float(squared_distances(rows, taken).sum()) + self.limit * int((~accepted).sum())

    def _admissible(self, rows: Array, accepted: Mask) -> Mask:
        values, spreads = self._tests(rows, accepted)
        return (values <= self.limit) & self._is_supported(values, spreads)

    def _is_supported(self, values: Array, spreads: Array) -> Mask:
        """Whether a loop is more likely right than wrong: an uncontradicted loop may still be uninformative."""
        density = -0.5 * (values + np.linalg.slogdet(2 * np.pi * spreads)[1])
        wrong = -np.log(2 * np.pi * self.settings.wrong_spread_m**2)
        share = self.settings.wrong_share
        return np.asarray(density + np.log(1 - share) > wrong + np.log(share))

    def _tests(self, rows: Array, accepted: Mask) -> tuple[Array, Array]:
        """Test value of each loop against all other accepted edges, (m,), and the covariance of its gap, (m, 3, 3)."""
        if not self.loops:
            return np.zeros(0), np.zeros((0, 3, 3))
        gaps = residuals(rows, self.loops)
        known = self._relative_covariances(rows, accepted)
        left = np.where(accepted[:, None, None], self.noises - known, self.noises + known)
        values = np.einsum("mi,mi->m", gaps, np.linalg.solve(left, gaps[..., None])[..., 0])
        # Left out, a loop's gap grows by noise / left, and so does its covariance.
        spread = np.where(accepted[:, None, None], self.noises @ np.linalg.solve(left, self.noises), left)
        return values, spread

    def _relative_covariances(self, rows: Array, accepted: Mask) -> Array:
        """Covariance that the accepted edges leave to each loop's gap, shape (m, 3, 3); left out in large graphs."""
        if self.large:
            return np.zeros_like(self.noises)
        joint = covariance_of(rows, [*self.odometry, *self._take(accepted)])
        by_start, by_end = jacobians(rows, self.loops)
        starts = np.array([loop.start for loop in self.loops])
        ends = np.array([loop.end for loop in self.loops])
        both = np.concatenate([by_start, by_end], axis=2)
        index = np.concatenate([starts[:, None], ends[:, None]], axis=1)
        columns = (3 * index[:, :, None] + np.arange(3)).reshape(len(index), 6)
        blocks = joint[columns[:, :, None], columns[:, None, :]]
        return np.asarray(both @ blocks @ both.transpose(0, 2, 1))

    def explain(self, state: _State) -> RobustSolution:
        """The verdicts with their reasons."""
        values, spreads = self._tests(state.rows, state.accepted)
        supported = self._is_supported(values, spreads)
        verdicts = [
            self._verdict(bool(taken), float(value), bool(backed))
            for taken, value, backed in zip(state.accepted, values, supported, strict=True)
        ]
        taken = self._take(state.accepted)
        return RobustSolution(state.rows, self._marginals(state.rows, taken), tuple(verdicts), state.cost)

    def _marginals(self, rows: Array, taken: Sequence[RelativePose]) -> Array:
        count = len(rows)
        if self.large:
            marginals = gtsam.Marginals(*gtsam_problem(self.odometry, taken, rows, None))
            return np.array([marginals.marginalCovariance(index) for index in range(count)])
        joint = covariance_of(rows, [*self.odometry, *taken])
        return np.asarray(joint.reshape(count, 3, count, 3)[np.arange(count), :, np.arange(count)])

    def _verdict(self, accepted: bool, value: float, supported: bool) -> LoopVerdict:
        words = f"test value {value:.1f}, limit {self.limit:.1f}"
        if accepted:
            reason = f"agrees with all other accepted loops and the motion ({words})"
        elif value > self.limit:
            reason = f"contradicts the loops that agree with each other ({words})"
        elif not supported:
            reason = f"unconfirmed: the poses there are too uncertain to distinguish it from a wrong loop ({words})"
        else:
            reason = f"belongs to a combination of loops that explains less ({words})"
        return LoopVerdict(accepted, value, self.limit, reason)
