"""Judging a session on the simulated hand: what counts as explored, and when a session ends."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from drivers.simulation.objects import object_model
from tactile_lab.experiments.catalogue import experiment
from tactile_lab.experiments.data.true_surface import lay_over, reachable_points, surface_within, true_share
from tactile_lab.experiments.runs.coverage_monitor import CoverageMonitor, Look
from tactile_lab.experiments.runs.hand_exploration import OBJECTS
from tactile_lab.slam.exploration.policy import Surface
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam


def test_outline_is_what_fingers_reach_in_the_plane() -> None:
    points = reachable_points(object_model("box-10x6x4").mesh, 2)
    assert len(points) == pytest.approx(320, abs=5)
    outside = np.maximum(np.abs(points) - [0.05, 0.03], 0.0)
    assert np.abs(outside).max() < 1e-9


def test_underside_is_out_of_reach_in_space() -> None:
    points = reachable_points(object_model("box-10x6x4").mesh, 3)
    assert points[:, 2].min() > -0.02 + 1e-6
    assert np.count_nonzero(points[:, 2] > 0.02 - 1e-6) > 300  # the top counts


def test_truth_is_laid_over_the_estimate_by_the_contacts() -> None:
    rng = np.random.default_rng(0)
    source = rng.normal(size=(20, 3))
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    moved = source @ turn.T + [0.3, -0.2, 0.1]
    np.testing.assert_allclose(lay_over(source[:5], source, moved), moved[:5], atol=1e-9)
    np.testing.assert_allclose(lay_over(source[:5, :2], source, moved), moved[:5, :2], atol=1e-9)


def monitored(shares: list[float], dimension: int, budget: int = 20) -> CoverageMonitor:
    """After grasps that cost three actions each and left so much explored, by each of the measures."""
    slam = TactileSlam(SlamSettings.model_validate({"dimension": dimension}))
    monitor = CoverageMonitor(object_model("cube-6").mesh, slam, lambda: None, dimension, budget)
    for share in shares:
        monitor.actions += 3
        monitor.looks.append(Look(monitor.actions, monitor.actions / 10, {"A": share, "B": share, "touched": share}))
    return monitor


@pytest.mark.parametrize(
    ("shares", "in_space", "in_the_plane"),
    [
        ([0.5, 0.92], None, 6),  # the next look has to confirm it
        ([0.5, 0.92, 0.95], 6, 6),
        ([0.92, 0.5, 0.92, 0.93], 9, 3),  # one lucky fit is no exploration
        ([0.5, 0.5, 0.92, 0.6], None, 9),
    ],
)
def test_in_space_two_successive_looks_have_to_agree(
    shares: list[float], in_space: int | None, in_the_plane: int
) -> None:
    for dimension, actions in ((3, in_space), (2, in_the_plane)):
        monitor = monitored(shares, dimension)
        assert monitor.is_explored == monitor.is_over == (actions is not None)
        figures = monitor.figures(TactileSlam().finish())
        assert figures["actions_A"] == actions
        assert figures["at_most_A"] == (actions or 20)


@pytest.mark.parametrize(("budget", "actions"), [(6, 6), (5, None), (7, None)])
def test_the_last_look_of_the_budget_needs_no_other(budget: int, actions: int | None) -> None:
    monitor = monitored([0.5, 0.92], 3, budget)
    assert monitor.figures(TactileSlam().finish())["actions_A"] == actions


def test_runs_of_the_experiment() -> None:
    study = experiment("exploration-hand")
    cells = study.cells([1000], {"object": ["box-10x6x4"], "dimension": ["3"]})
    assert [cell["policy"] for cell in cells] == ["random", "variance", "clusters", "information"]
    assert len(OBJECTS) == 8
    assert len(study.cells([1000])) == 8 * 2 * 4


def test_what_an_estimate_adds_to_an_object_is_not_true() -> None:
    true_mesh = object_model("cube-6").mesh
    estimate = trimesh.creation.box((0.06, 0.06, 0.06)).subdivide_to_size(0.006)
    surface = Surface(
        np.array(estimate.vertices), estimate.vertex_normals, np.full(len(estimate.vertices), 1e-3), estimate.faces
    )
    assert true_share(surface, 0.03, true_mesh, 0.005) == pytest.approx(1.0)
    surface.points_m[surface.points_m[:, 0] > 0.0299, 0] += 0.02  # one side of five 20 mm too far out
    share = true_share(surface, 0.03, true_mesh, 0.005)
    assert 0.6 < share < 0.8
    assert surface_within(surface, reachable_points(true_mesh, 3), 0.005).mean() > share
