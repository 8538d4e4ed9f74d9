"""The robust pose graph: wrong loops are found and named, odometry is not trusted as a start."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.runs.graph_runs import OUR_SOLVER, solve_stressed_graph
from tactile_lab.experiments.runs.graph_stress import (
    LOOP_SIGMAS,
    ODOMETRY_SIGMAS,
    StressSettings,
    stress_graph,
    trajectory_errors,
)
from tactile_lab.slam.graph.least_squares import covariance_of
from tactile_lab.slam.graph.relative_poses import RelativePose, chain, jacobians, residuals
from tactile_lab.slam.graph.robust import RobustSettings, solve_robustly
from tactile_lab.slam.tracking.contacts.motion import compose, inverse


def test_residuals_vanish_at_the_poses_the_edges_were_made_from() -> None:
    graph = stress_graph(0)
    edges = [
        RelativePose(e.start, e.end, compose(inverse(graph.rows[e.start]), graph.rows[e.end]), e.covariance)
        for e in graph.loops
    ]
    assert np.abs(residuals(graph.rows, edges)).max() < 1e-12


def test_jacobians_are_the_derivatives_of_the_residuals() -> None:
    graph = stress_graph(1)
    right = [loop for loop, wrong in zip(graph.loops, graph.wrong, strict=True) if not wrong][:10]
    by_start, by_end = jacobians(graph.rows, right)
    step = 1e-6
    for index, edge in enumerate(right):
        for axis in range(3):
            for node, expected in ((edge.start, by_start), (edge.end, by_end)):
                moved = graph.rows.copy()
                moved[node] = compose(moved[node], np.eye(3)[axis] * step)
                slope = (residuals(moved, [edge]) - residuals(graph.rows, [edge]))[0] / step
                assert np.allclose(slope, expected[index, :, axis], atol=1e-4)


def test_wrong_loops_are_refused_by_name_and_right_ones_accepted() -> None:
    figures = [solve_stressed_graph(Cell((("solver", OUR_SOLVER),), seed)) for seed in range(1000, 1010)]
    assert sum(each["wrong_accepted"] for each in figures) == 0
    assert sum(each["right_refused"] for each in figures) <= 6
    assert np.median([each["error_mm"] for each in figures]) < 7.5
    assert np.median([each["error_deg"] for each in figures]) < 8.0


def test_aliases_about_the_object_s_own_origin_are_refused_as_well() -> None:
    graphs = [stress_graph(seed, StressSettings(alias_centre_m=0.0)) for seed in range(1000, 1010)]
    accepted = [solve_robustly(graph.odometry, graph.loops).accepted for graph in graphs]
    assert sum(int((taken & graph.wrong).sum()) for taken, graph in zip(accepted, graphs, strict=True)) <= 2


def test_every_loop_has_a_verdict_in_words() -> None:
    graph = stress_graph(1003)
    solution = solve_robustly(graph.odometry, graph.loops)
    assert len(solution.verdicts) == len(graph.loops)
    for verdict in solution.verdicts:
        if verdict.accepted:
            assert verdict.test_value <= verdict.limit
            assert "agrees with" in verdict.reason
        else:
            assert any(word in verdict.reason for word in ("contradicts", "unconfirmed", "explains less"))


def test_the_same_graph_gives_the_same_solution() -> None:
    graph = stress_graph(1001)
    first, second = (solve_robustly(graph.odometry, graph.loops) for _ in range(2))
    assert np.array_equal(first.rows, second.rows)
    assert first.verdicts == second.verdicts


def test_without_loops_the_poses_are_those_of_odometry() -> None:
    graph = stress_graph(2)
    start = np.array([0.3, -0.2, 1.0])
    solution = solve_robustly(graph.odometry, [], first=start)
    assert np.allclose(solution.rows, chain(graph.odometry, start), atol=1e-6)
    assert solution.verdicts == ()


def test_the_first_pose_is_where_it_was_put() -> None:
    graph = stress_graph(1004)
    start = np.array([0.3, -0.2, 1.0])
    solution = solve_robustly(graph.odometry, graph.loops, first=start)
    at_origin = solve_robustly(graph.odometry, graph.loops)
    assert np.allclose(solution.rows[0], start, atol=1e-5)
    assert trajectory_errors(solution.rows, compose(np.tile(start, (50, 1)), at_origin.rows))[0] < 1e-4


def test_a_loop_that_nothing_confirms_over_an_uncertain_path_stays_out() -> None:
    """After thirty steps of 20 degrees a single loop may say anything."""
    graph = stress_graph(3)
    lone = RelativePose(2, 32, np.array([0.05, 0.02, 2.0]), np.diag(LOOP_SIGMAS**2))
    (verdict,) = solve_robustly(graph.odometry, [lone], RobustSettings(wrong_share=0.5)).verdicts
    assert not verdict.accepted
    assert "unconfirmed" in verdict.reason


def test_covariances_grow_along_odometry_and_shrink_at_loops() -> None:
    graph = stress_graph(4)
    alone = solve_robustly(graph.odometry, [])
    tied = solve_robustly(graph.odometry, graph.loops)
    assert np.all(np.diff(alone.covariances[1:, 2, 2]) > 0)
    assert np.all(tied.covariances[1:, 2, 2] <= alone.covariances[1:, 2, 2] + 1e-12)
    assert alone.covariances[1, 2, 2] == pytest.approx(ODOMETRY_SIGMAS[2] ** 2, rel=1e-6)


def test_the_covariance_of_two_nodes_is_the_edge_s() -> None:
    covariance = np.diag([1e-6, 4e-6, 1e-4])
    edge = RelativePose(0, 1, np.array([0.1, 0.0, 0.5]), covariance)
    joint = covariance_of(chain([edge], np.zeros(3)), [edge])
    assert np.allclose(joint[3:, 3:], covariance)


def read_edges(path: Path) -> tuple[list[RelativePose], list[RelativePose]]:
    """Odometry and loops of a planar graph in one of the usual text forms; diagonal weights are enough here."""
    odometry: list[RelativePose] = []
    loops: list[RelativePose] = []
    for words in map(str.split, path.read_text(encoding="utf-8").splitlines()):
        if words and words[0] in {"EDGE_SE2", "ODOMETRY", "EDGE2"}:
            start, end, *numbers = int(words[1]), int(words[2]), *map(float, words[3:])
            weights = np.array([numbers[3], numbers[6], numbers[8]])
            edge = RelativePose(start, end, np.array(numbers[:3]), np.diag(1 / weights))
            (odometry if start == len(odometry) and end == start + 1 else loops).append(edge)
    return odometry, loops


def with_aliases(loops: list[RelativePose], share: float, seed: int) -> tuple[list[RelativePose], Array]:
    rng = np.random.default_rng(seed)
    wrong = rng.random(len(loops)) < share
    turns = rng.choice([np.pi / 2, np.pi, -np.pi / 2], len(loops))
    spoiled = [
        RelativePose(e.start, e.end, compose(e.pose, np.array([*rng.normal(0.0, 1.0, 2), turn])), e.covariance)
        if bad
        else e
        for e, turn, bad in zip(loops, turns, wrong, strict=True)
    ]
    return spoiled, wrong


def test_intel_keeps_its_shape_with_a_fifth_of_the_loops_wrong(lab_data: Path) -> None:
    odometry, loops = read_edges(lab_data / "pose_graphs" / "intel.g2o")
    spoiled, wrong = with_aliases(loops, 0.2, seed=0)
    clean, solution = solve_robustly(odometry, loops), solve_robustly(odometry, spoiled)
    assert not np.any(solution.accepted & wrong)
    assert np.mean(solution.accepted[~wrong]) > 0.99
    assert trajectory_errors(solution.rows, clean.rows)[0] < 0.3, "of some 25 m"
    assert np.isfinite(solution.covariances).all()


@pytest.mark.long
def test_manhattan_is_where_it_is_with_a_fifth_of_the_loops_wrong(lab_data: Path) -> None:
    odometry, loops = read_edges(lab_data / "pose_graphs" / "manhattanOlson3500.txt")
    true_steps, _ = read_edges(lab_data / "pose_graphs" / "manhattanOlson3500_groundtruth.txt")
    spoiled, wrong = with_aliases(loops, 0.2, seed=0)
    solution = solve_robustly(odometry, spoiled)
    assert not np.any(solution.accepted & wrong)
    assert np.mean(solution.accepted[~wrong]) > 0.99
    truth = chain(true_steps, np.zeros(3))[: len(solution.rows)]
    assert trajectory_errors(chain(odometry, np.zeros(3)), truth)[0] > 10.0
    assert trajectory_errors(solution.rows, truth)[0] < 1.5
