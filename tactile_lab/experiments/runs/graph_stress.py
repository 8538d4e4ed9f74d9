"""Stress test of pose graphs: wrong loops among right ones, and odometry that is too poor as an initial estimate.

An object is turned 50 times. Odometry is uncertain by 10 mm and 20 degrees per step; loops between random pairs of
grasps are accurate to 1 mm and 2 degrees, but a fifth of them are aliases: they match the object with itself rotated by
90 or 180 degrees about some point. The test compares gtsam's solvers with their default settings, started from
odometry; the same solvers knowing the right loops ("oracle"); and :func:`tactile_lab.slam.graph.robust.solve_robustly`.

The number of loops, the object's own motion and the place of the aliases' centre were chosen once so that the stock
solvers reproduce the figures of an earlier study of this setting (``docs/results/graph-stress.md``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import gtsam
import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.poses import wrap_angle_rad
from tactile_lab.slam.graph.least_squares import solve
from tactile_lab.slam.graph.relative_poses import RelativePose, chain
from tactile_lab.slam.tracking.contacts.motion import compose, inverse, pose_vector, vector_pose

ODOMETRY_SIGMAS = np.array([0.010, 0.010, np.deg2rad(20.0)])
LOOP_SIGMAS = np.array([0.001, 0.001, np.deg2rad(2.0)])
ALIASES_rad = np.deg2rad([90.0, 180.0, -90.0])


@dataclass(frozen=True)
class StressSettings:
    """Settings of the test.

    Attributes:
        grasps: number of poses.
        loops: number of loops, between random different pairs at least two apart.
        wrong_share: probability that a loop is an alias.
        motion_m: the object's true motion per step, standard deviation per axis; it turns by up to 25 degrees.
        alias_centre_m: standard deviation, per axis, of the point about which an alias is rotated.
    """

    grasps: int = 50
    loops: int = 60
    wrong_share: float = 0.2
    motion_m: float = 0.010
    alias_centre_m: float = 0.060


@dataclass(frozen=True)
class StressGraph:
    """A graph and the truth.

    Attributes:
        rows: true poses (x_m, y_m, yaw_rad), shape (n, 3).
        odometry, loops: measured relative poses.
        wrong: which loops are aliases, shape (m,).
    """

    rows: Array
    odometry: tuple[RelativePose, ...]
    loops: tuple[RelativePose, ...]
    wrong: NDArray[np.bool_]


def stress_graph(seed: int, settings: StressSettings | None = None) -> StressGraph:
    """A random graph; the same seed and settings give the same."""
    settings = settings or StressSettings()
    rng = np.random.default_rng([seed, 33])
    motions = np.column_stack(
        [
            rng.normal(0.0, settings.motion_m, (settings.grasps - 1, 2)),
            rng.uniform(-np.deg2rad(25.0), np.deg2rad(25.0), settings.grasps - 1),
        ]
    )
    measured = compose(motions, rng.normal(size=motions.shape) * ODOMETRY_SIGMAS)
    covariance = np.diag(ODOMETRY_SIGMAS**2)
    truth = chain([RelativePose(k, k + 1, row, covariance) for k, row in enumerate(motions)], np.zeros(3))
    odometry = tuple(RelativePose(k, k + 1, row, covariance) for k, row in enumerate(measured))
    pairs = _pairs(rng, settings)
    wrong = rng.random(len(pairs)) < settings.wrong_share
    loops = tuple(_loop(rng, truth, *pair, bool(alias), settings) for pair, alias in zip(pairs, wrong, strict=True))
    return StressGraph(truth, odometry, loops, wrong)


def _pairs(rng: np.random.Generator, settings: StressSettings) -> list[tuple[int, int]]:
    possible = [(i, j) for i in range(settings.grasps) for j in range(i + 2, settings.grasps)]
    return [possible[k] for k in rng.choice(len(possible), settings.loops, replace=False)]


def _loop(
    rng: np.random.Generator, truth: Array, start: int, end: int, alias: bool, settings: StressSettings
) -> RelativePose:
    row = compose(compose(inverse(truth[start]), truth[end]), rng.normal(size=3) * LOOP_SIGMAS)
    turn = np.array([0.0, 0.0, rng.choice(ALIASES_rad)])
    centre = np.array([*rng.normal(0.0, settings.alias_centre_m, 2), 0.0])
    if alias:
        row = compose(row, compose(compose(centre, turn), inverse(centre)))
    return RelativePose(start, end, row, np.diag(LOOP_SIGMAS**2))


def stock_solvers() -> dict[str, Callable[[StressGraph], Array]]:
    """gtsam's solvers with their standard parameters, started from odometry: poses of shape (n, 3) from a graph."""
    estimators = gtsam.noiseModel.mEstimator
    return {
        "Levenberg-Marquardt": lambda graph: _from_odometry(graph, None),
        "Huber": lambda graph: _from_odometry(graph, estimators.Huber.Create(1.345)),
        "DCS": lambda graph: _from_odometry(graph, estimators.DCS.Create(1.0)),
        "GNC": _graduate,
        "Cauchy": lambda graph: _from_odometry(graph, estimators.Cauchy.Create(1.0)),
        "oracle": _solve_with_right_loops,
        "oracle, true start": _solve_with_truth,
    }


def _from_odometry(graph: StressGraph, cost: gtsam.noiseModel.mEstimator.Base | None) -> Array:
    factors, start = _gtsam_problem(graph, cost)
    return _rows(gtsam.LevenbergMarquardtOptimizer(factors, start).optimize(), graph)


def _graduate(graph: StressGraph) -> Array:
    factors, start = _gtsam_problem(graph, None)
    return _rows(gtsam.GncLMOptimizer(factors, start, gtsam.GncLMParams()).optimize(), graph)


def _solve_with_right_loops(graph: StressGraph) -> Array:
    right = [loop for loop, wrong in zip(graph.loops, graph.wrong, strict=True) if not wrong]
    return solve(graph.odometry, right, chain(graph.odometry, np.zeros(3)))


def _solve_with_truth(graph: StressGraph) -> Array:
    """Solve with the right loops, starting at the truth: no solver can be expected to do better."""
    right = [loop for loop, wrong in zip(graph.loops, graph.wrong, strict=True) if not wrong]
    return solve(graph.odometry, right, graph.rows)


def _gtsam_problem(
    graph: StressGraph, cost: gtsam.noiseModel.mEstimator.Base | None
) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    factors, start = gtsam.NonlinearFactorGraph(), gtsam.Values()
    anchor = gtsam.noiseModel.Diagonal.Sigmas(np.full(3, 1e-6))
    factors.add(gtsam.PriorFactorPose2(0, vector_pose(np.zeros(3)), anchor))
    for index, row in enumerate(chain(graph.odometry, np.zeros(3))):
        start.insert(index, vector_pose(row))
    for edge in (*graph.odometry, *graph.loops):
        noise: gtsam.noiseModel.Base = gtsam.noiseModel.Gaussian.Covariance(edge.covariance)
        if cost is not None and edge.end != edge.start + 1:
            noise = gtsam.noiseModel.Robust.Create(cost, noise)
        factors.add(gtsam.BetweenFactorPose2(edge.start, edge.end, vector_pose(edge.pose), noise))
    return factors, start


def _rows(values: gtsam.Values, graph: StressGraph) -> Array:
    return np.array([pose_vector(values.atPose2(index)) for index in range(len(graph.rows))])


def trajectory_errors(rows: Array, truth: Array) -> tuple[float, float]:
    """Root mean square errors of positions (m) and headings (rad)."""
    gaps = rows - truth
    metres = float(np.sqrt(np.mean(np.sum(gaps[:, :2] ** 2, axis=1))))
    return metres, float(np.sqrt(np.mean(wrap_angle_rad(gaps[:, 2]) ** 2)))
