"""Every policy by name, and what each does where there is nothing to choose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose2

from drivers.core.errors import ConfigurationError
from tactile_lab.slam.exploration.candidates import Candidate
from tactile_lab.slam.exploration.expected_information import InformationSettings, predict_promise, unexplored_vertices
from tactile_lab.slam.exploration.information_policy import InformationPolicy
from tactile_lab.slam.exploration.policies import POLICIES, make_policy
from tactile_lab.slam.exploration.policy import Belief, Decision
from tactile_lab.slam.exploration.pose_policies import PoseSwitchSettings
from tactile_lab.slam.exploration.surface_policies import ClustersPolicy, expected_contacts, variances_at
from tactile_lab.slam.exploration.ten_candidates import TEN_PALMS, candidates_at, shift
from tests.support.rectangle_world import belief_of, belief_of_right_end_unknown, contacts_every, ten, uncertain

SIGMAS = np.array([0.01, 0.01, 0.35])
FAR = Pose2(5.0, 5.0, 0.0)


def choose(name: str, belief: Belief, candidates: tuple[Candidate, ...] | None = None, seed: int = 0) -> Decision:
    return make_policy(name).choose(ten() if candidates is None else candidates, belief, np.random.default_rng(seed))


@pytest.fixture(scope="module")
def half_known() -> Belief:
    return uncertain(belief_of_right_end_unknown(), SIGMAS)


@pytest.mark.parametrize("name", POLICIES)
def test_every_policy_chooses_one_of_the_candidates_and_says_why(name: str, half_known: Belief) -> None:
    decision = choose(name, half_known)
    assert decision.policy == name
    assert decision.outcome == "grasp"
    assert decision.chosen in range(10)
    assert len(decision.scores) == 10
    assert len(decision.reason.split()) > 3
    if name != "random":
        assert decision.scores[decision.chosen] == max(decision.scores)


@pytest.mark.parametrize("name", POLICIES)
def test_the_same_seed_gives_the_same_decision(name: str, half_known: Belief) -> None:
    assert choose(name, half_known, seed=4) == choose(name, half_known, seed=4)


@pytest.mark.parametrize("name", POLICIES)
def test_a_spent_budget_stops_every_policy(name: str, half_known: Belief) -> None:
    decision = choose(name, replace(half_known, grasps_left=0))
    assert (decision.outcome, decision.chosen) == ("stop", None)
    assert "budget" in decision.reason


@pytest.mark.parametrize("name", POLICIES)
def test_without_candidates_every_policy_says_that_nothing_can_be_reached(name: str, half_known: Belief) -> None:
    decision = choose(name, half_known, ())
    assert (decision.outcome, decision.chosen) == ("nothing", None)
    assert "no candidate can be reached" in decision.reason


@pytest.mark.parametrize("name", [name for name in POLICIES if name != "random"])
def test_an_object_out_of_reach_of_all_candidates_is_told(name: str, half_known: Belief) -> None:
    decision = choose(name, half_known, candidates_at(TEN_PALMS, FAR, ten()[0].rays))
    assert (decision.outcome, decision.chosen) == ("nothing", None)
    assert "no candidate is expected to touch" in decision.reason
    assert all(score == -np.inf for score in decision.scores)


@pytest.mark.parametrize("name", [name for name in POLICIES if name != "random"])
def test_equal_candidates_are_chosen_among_by_chance_and_told(name: str, half_known: Belief) -> None:
    same = (ten()[2],) * 4
    found = {choose(name, half_known, same, seed).chosen for seed in range(12)}
    assert len(found) > 1
    assert "chosen among them by chance" in choose(name, half_known, same).reason


@pytest.mark.parametrize("name", [name for name in POLICIES if name != "random"])
def test_contacts_that_enclose_nothing_leave_the_choice_to_chance(name: str, half_known: Belief) -> None:
    decision = choose(name, replace(half_known, surface=None))
    assert decision.outcome == "grasp"
    assert "enclose nothing" in decision.reason


def test_a_policy_that_does_not_exist_is_told_with_those_that_do() -> None:
    with pytest.raises(ConfigurationError, match=r"there is no policy 'best'.*information"):
        make_policy("best")


def test_the_variance_reward_is_the_sum_at_the_expected_contacts(half_known: Belief) -> None:
    assert half_known.surface is not None
    found = expected_contacts(ten(), half_known, half_known.surface)
    rewards = [float(half_known.field.predict(points, variance=True).variance_m2.sum()) for points in found]
    assert choose("variance", half_known).scores == pytest.approx(rewards)
    assert [len(own) for own in variances_at(half_known, found)] == [len(points) for points in found]


@pytest.mark.parametrize("name", ["variance", "entropy", "information", "clusters"])
def test_policies_for_the_shape_go_where_the_surface_is_unknown(name: str, half_known: Belief) -> None:
    known = replace(half_known, pose_covariance=np.zeros((3, 3)), particles=np.empty((0, 3)), weights=np.empty(0))
    candidates = candidates_at(np.array([[0.035, 0.0, 0.0], [-0.035, 0.0, np.pi]]), Pose2(), ten()[0].rays)
    assert choose(name, known, candidates).chosen == 0


def test_the_switch_acts_for_the_pose_only_while_it_is_uncertain(half_known: Belief) -> None:
    for name in ("det", "det-modes", "kl", "mutual-information", "renyi"):
        assert choose(name, half_known).reason.startswith("the pose is uncertain (10 mm, 10 mm, 20 deg)")
        sure = replace(half_known, pose_covariance=np.diag([1e-6, 1e-6, 1e-4]))
        decision = choose(name, sure)
        assert decision.reason.startswith("the pose is known well enough")
        assert decision.chosen == choose("variance", sure).chosen
        gaussian = replace(half_known, particles=np.empty((0, 3)), weights=np.empty(0))
        assert choose(name, gaussian).reason.startswith("the pose is uncertain")


def test_the_threshold_is_the_determinant_of_a_pose_known_so_well() -> None:
    settings = PoseSwitchSettings(translation_m=0.002, rotation_rad=0.1)
    assert settings.threshold == pytest.approx(np.linalg.det(np.diag([4e-6, 4e-6, 0.01])))


def test_for_the_pose_a_grasp_all_round_beats_one_finger(half_known: Belief) -> None:
    full = ten()[1]
    one = replace(full, rays=replace(full.rays, lengths_m=np.array([0.24, 0.0, 0.0, 0.0, 0.0])))
    for name in ("det", "det-modes", "kl", "renyi", "information"):
        assert choose(name, half_known, (one, full)).chosen == 1


def test_a_region_that_never_yields_comes_last(half_known: Belief) -> None:
    assert half_known.surface is not None
    policy = ClustersPolicy()
    regions = policy._in_turn(half_known, half_known.surface)
    assert len(regions) > 1
    missed = np.tile(half_known.surface.points_m[regions[0].members[0]], (3, 1))
    again = policy._in_turn(replace(half_known, missed_m=missed), half_known.surface)
    assert set(again[-1].members) == set(regions[0].members)


def test_misses_halve_what_information_hopes_for_there(half_known: Belief) -> None:
    surface = half_known.surface
    assert surface is not None
    candidates = candidates_at(np.array([[0.035, 0.0, 0.0]]), Pose2(), ten()[0].rays)
    settings, rng = InformationSettings(), np.random.default_rng
    before = predict_promise(candidates, half_known, surface, settings, rng(0))
    fresh = surface.points_m[unexplored_vertices(surface, half_known, settings.reach_m)]
    after = predict_promise(
        candidates, replace(half_known, missed_m=np.repeat(fresh, 2, axis=0)), surface, settings, rng(0)
    )
    assert after.shape[0] < 0.3 * before.shape[0]
    assert after.new_share == pytest.approx(before.new_share)


def test_digits_finer_than_the_wanted_accuracy_are_nobodys_gain(half_known: Belief) -> None:
    assert half_known.surface is not None
    shape = [
        predict_promise(
            ten(), half_known, half_known.surface, InformationSettings(accuracy_m=a), np.random.default_rng(0)
        ).shape
        for a in (0.0, 0.005, 0.05)
    ]
    assert (shape[0] > shape[1]).all()
    assert (shape[2] < 0.1 * shape[0]).all()


def test_a_fully_known_surface_lets_clusters_fall_back_to_variance() -> None:
    belief = belief_of(*contacts_every(0.005))
    decision = choose("clusters", belief)
    assert decision.outcome == "grasp"
    assert "largest variance counts instead" in decision.reason


def test_information_per_second_prefers_the_quicker_of_equal_grasps(half_known: Belief) -> None:
    slow, quick = replace(ten()[3], time_s=20.0), replace(ten()[3], time_s=10.0)
    decision = choose("information", half_known, (slow, quick))
    assert decision.chosen == 1
    assert decision.scores[1] == pytest.approx(2 * decision.scores[0])


def test_information_stops_when_too_little_is_promised(half_known: Belief) -> None:
    greedy = InformationPolicy(InformationSettings(least_gain=1e6))
    decision = greedy.choose(ten(), half_known, np.random.default_rng(0))
    assert (decision.outcome, decision.chosen) == ("stop", None)
    assert "nats" in decision.reason


def test_information_stops_when_the_surface_is_touched_and_known_well_enough() -> None:
    policy = InformationPolicy(InformationSettings(known_sigma_m=0.005))
    done = policy.choose(ten(), belief_of(*contacts_every(0.005)), np.random.default_rng(0))
    assert done.outcome == "stop"
    assert "has been touched" in done.reason
    unfinished = policy.choose(ten(), belief_of_right_end_unknown(), np.random.default_rng(0))
    assert unfinished.outcome == "grasp"


def test_what_is_promised_is_what_a_contact_everywhere_would_make_new(half_known: Belief) -> None:
    surface = half_known.surface
    assert surface is not None
    promise = predict_promise(ten(), half_known, surface, InformationSettings(), np.random.default_rng(0))
    left = surface.sizes[unexplored_vertices(surface, half_known, 0.0045)].sum() / surface.sizes.sum()
    assert np.all(promise.new_share > 0)
    assert np.all(promise.new_share < left)
    assert np.all(promise.touching <= 5)


def test_ten_candidates_surround_the_object_and_can_be_shifted() -> None:
    assert len(ten()) == 10
    assert np.rad2deg(TEN_PALMS[:, 2]) == pytest.approx(36.0 * np.arange(10))
    moved = shift(TEN_PALMS, 0.006, 0.1)
    assert moved.shape == (70, 3)
    assert moved[::7] == pytest.approx(TEN_PALMS)
    assert np.linalg.norm(moved[1, :2] - TEN_PALMS[0, :2]) == pytest.approx(0.006)
