"""Judging a session on the simulated hand: what counts as explored, and when a session ends."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.simulation.objects import object_model
from tactile_lab.experiments.catalogue import experiment
from tactile_lab.experiments.hand_exploration import OBJECTS
from tactile_lab.experiments.hand_judge import laid_over, reachable_points


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
    np.testing.assert_allclose(laid_over(source[:5], source, moved), moved[:5], atol=1e-9)
    np.testing.assert_allclose(laid_over(source[:5, :2], source, moved), moved[:5, :2], atol=1e-9)


def test_runs_of_the_experiment() -> None:
    study = experiment("exploration-hand")
    cells = study.cells([1000], {"object": ["box-10x6x4"], "dimension": ["3"]})
    assert [cell["policy"] for cell in cells] == ["random", "variance", "clusters", "information"]
    assert len(OBJECTS) == 8
    assert len(study.cells([1000])) == 8 * 2 * 4
