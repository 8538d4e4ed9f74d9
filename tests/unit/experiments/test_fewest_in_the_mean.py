"""The lower bound of every policy: exact where the optimum is known, below it elsewhere, and the law of the errors."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose2
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ks_2samp

from tactile_lab.experiments import fewest_in_the_mean as bound
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.exploration_runs import LOWER_BOUND, OUTLINE_m, explore_fixed
from tactile_lab.experiments.fewest_in_the_mean import GraspsStillNeeded, Law, fewest_in_the_mean
from tactile_lab.experiments.mean_field import grasps_to_go
from tactile_lab.experiments.planar_hand import PlanarHand, measured_landings
from tactile_lab.exploration.ten_candidates import TEN_PALMS
from tactile_lab.geometry.contacts import Array


def two_pairs() -> Law:
    """Two pairs of places, a candidate for each, which touches both or neither: four grasps in the mean, two a pair."""
    touched = np.zeros((2, 2, 4), dtype=bool)
    touched[0, 0, :2] = touched[1, 0, 2:] = True
    return Law(touched, touched.mean(axis=1).T.astype(np.float32), allowed=1)


def bounds(law: Law, parabola: tuple[float, float, float], runs: int) -> Array:
    needed = GraspsStillNeeded(law, parabola)
    return np.array([fewest_in_the_mean(needed, np.random.default_rng([3, run])) for run in range(runs)])


def test_mean_field_grasps_uncover_their_share_and_the_last_one_counts_in_part() -> None:
    half = np.full((10, 1), 0.5, dtype=np.float32)
    everything = np.ones(10, dtype=np.float32)
    assert grasps_to_go(everything, half, 1) == pytest.approx(3.4)  # 10, 5, 2.5, 1.25, and 0.4 of 0.625 more
    assert grasps_to_go(everything * 0.05, half, 1) == 0.0
    better = np.hstack([half, np.full((10, 1), 0.9, dtype=np.float32)])
    assert grasps_to_go(everything, better, 1) == pytest.approx(1.0)


def test_places_that_nobody_reaches_take_long_and_not_for_ever() -> None:
    never = np.zeros((10, 1), dtype=np.float32)
    assert grasps_to_go(np.ones(10, dtype=np.float32), never, 1) > 1e3


def test_with_the_true_number_of_grasps_still_needed_a_drawing_varies_with_the_first_grasp_alone() -> None:
    # Mean field says 4 and 1 grasps to go for two pairs and one; truly it is 4 and 2, on the line 4/3 + 2/3 n.
    start = np.ones(4, dtype=np.float32)
    law = two_pairs()
    assert grasps_to_go(start, law.means, law.allowed) == pytest.approx(4.0)
    assert grasps_to_go(start * np.array([1, 1, 0, 0], dtype=np.float32), law.means, law.allowed) == pytest.approx(1.0)
    found = bounds(law, (4 / 3, 2 / 3, 0.0), 20)
    touched = found < 4.0
    assert 3 < touched.sum() < 17
    assert found == pytest.approx(1.0 + np.where(touched, 2.0, 4.0), abs=1e-6)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.0, 3.0), st.floats(0.0, 1.5), st.floats(-0.1, 0.1))
def test_no_parabola_lifts_the_bound_over_what_the_best_policy_needs(flat: float, slope: float, bend: float) -> None:
    found = bounds(two_pairs(), (flat, slope, bend), 60)
    assert found.mean() < 4.0 + 4.0 * found.std() / np.sqrt(len(found)) + 1e-6


def test_where_nothing_is_left_to_chance_the_bound_is_the_fewest_grasps() -> None:
    touched = np.zeros((3, 1, 6), dtype=bool)
    touched[0, 0, :4] = touched[1, 0, 3:5] = touched[2, 0, 5:] = True  # all three are needed
    law = Law(touched, touched.mean(axis=1).T.astype(np.float32), allowed=0)
    assert bounds(law, (0.3, 0.9, 0.0), 5) == pytest.approx(np.full(5, 3.0), abs=1e-6)


def test_a_law_counts_the_places_near_contacts() -> None:
    places = np.column_stack([np.arange(10.0), np.zeros(10)])
    contacts = np.array([[[[2.2, 0.5], [np.inf, 0.0]], [[7.0, 3.0], [9.4, 0.0]]]])
    law = Law.of(contacts, places, near_m=1.0, goal=0.9)
    assert law.allowed == 1
    assert np.flatnonzero(law.touched[0, 0]).tolist() == [2, 3]
    assert np.flatnonzero(law.touched[0, 1]).tolist() == [9]
    assert law.means[:, 0].tolist() == [0, 0, 0.5, 0.5, 0, 0, 0, 0, 0, 0.5]


@pytest.mark.parametrize("palm", TEN_PALMS[[0, 3, 7]])
def test_many_landings_at_once_follow_the_law_of_the_hand(palm: Array) -> None:
    hand = PlanarHand(OUTLINE_m, np.random.default_rng(0))
    one_by_one = np.array([hand.grasp(0, Pose2(*palm), Pose2()).points_world_m[:, :2] for _ in range(300)])
    at_once = measured_landings(OUTLINE_m, palm, 3000, np.random.default_rng(1))
    assert np.isfinite(at_once).all()
    for finger in range(5):
        for axis in range(2):
            assert ks_2samp(one_by_one[:, finger, axis], at_once[:, finger, axis]).pvalue > 1e-3


def test_landings_beside_the_object_are_not_finite() -> None:
    assert not np.isfinite(measured_landings(OUTLINE_m, np.array([3.0, 0.0, 0.0]), 4, np.random.default_rng(0))).any()


def test_nobody_explores_the_rectangle_in_as_few_grasps_as_one_who_knows_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bound, "_BEAM", 4)
    monkeypatch.setattr(bound, "_SAMPLES", 60)
    setting = (("candidates", "10"), ("policy", LOWER_BOUND), ("grasps", 80))
    found = [explore_fixed(Cell(setting, seed))["actions_B"] for seed in (0, 1)]
    assert min(found) > 13.0
    assert max(found) < 17.5
