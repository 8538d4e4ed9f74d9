"""Explorations of the rectangle: the hand, what counts as explored, the bounds, and whole runs."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose2

from drivers.core.poses import planar
from tactile_lab.benchmarks.decision_times import box_belief, box_candidates, decision_table
from tactile_lab.experiments.cells import Cell, Row
from tactile_lab.experiments.coverage_criteria import CONTACT_m, ExploredMap, isolated_variance
from tactile_lab.experiments.data.explored_objects import MovingObject, moved_alike
from tactile_lab.experiments.data.planar_hand import PlanarHand, slip
from tactile_lab.experiments.figure_texts import correlation
from tactile_lab.experiments.groups import Column, Group
from tactile_lab.experiments.runs.exploration_runs import (
    CLAIRVOYANT,
    INFORMED,
    OUTLINE_m,
    TRUE_POINTS_m,
    explore_fixed,
    explore_moving,
    fixed_settings,
    moving_settings,
    palms_called,
)
from tactile_lab.experiments.runs.limits.oracle import fewest_grasps
from tactile_lab.experiments.summary import table
from tactile_lab.slam.exploration.ten_candidates import TEN_PALMS
from tests.support.rectangle_world import contacts_every


def cell(seed: int = 0, **setting: str | int) -> Cell:
    return Cell(
        tuple({"candidates": "10", "tracking": "joint", "policy": "random", "grasps": 4, **setting}.items()), seed
    )


def test_the_hand_touches_the_outline_where_the_object_is() -> None:
    hand, pose = PlanarHand(OUTLINE_m, np.random.default_rng(0)), Pose2(0.4, 0.1, 1.0)
    grasp = hand.grasp(3, pose.compose(Pose2(*TEN_PALMS[2])), pose)
    points = np.array([pose.transformTo(point[:2]) for point in grasp.points_world_m])
    assert len(points) == 5
    assert np.linalg.norm(points[:, None] - TRUE_POINTS_m[None], axis=-1).min(axis=1).max() < 0.005
    assert all(line.touched for line in grasp.approach_paths)


def test_a_palm_that_misses_the_object_closes_on_nothing() -> None:
    grasp = PlanarHand(OUTLINE_m, np.random.default_rng(0)).grasp(0, Pose2(3.0, 0.0, 0.0), Pose2())
    assert grasp.contacts == ()
    assert not any(line.touched for line in grasp.approach_paths)


def test_a_push_turns_the_object_about_the_frame_that_is_followed() -> None:
    body_T_frame = Pose2(0.03, 0.01, 0.5)
    rng = np.random.default_rng(0)
    moved = slip(Pose2(), body_T_frame, np.array([0.0, 0.0, 0.3]), rng)
    assert abs(moved.theta()) > 0.0
    frame = moved.compose(body_T_frame)
    assert [frame.x(), frame.y()] == pytest.approx([0.03, 0.01])


def test_only_what_has_a_contact_nearby_is_explored_by_b() -> None:
    points, normals = contacts_every(0.02)
    explored = ExploredMap.of(points, normals).explored_points("B", TRUE_POINTS_m)
    near = np.linalg.norm(TRUE_POINTS_m[:, None] - points[None], axis=-1).min(axis=1) < CONTACT_m
    assert 0.3 < explored.mean() < 0.6
    assert not np.any(explored & ~near)
    dense = ExploredMap.of(*contacts_every(0.006))
    assert dense.explored_points("B", TRUE_POINTS_m).mean() > 0.95
    assert not dense.explored_points("B", TRUE_POINTS_m + 0.008).all()


def test_a_forgives_gaps_that_b_does_not() -> None:
    known = ExploredMap.of(*contacts_every(0.015))
    a3, a5, b = (known.explored_points(name, TRUE_POINTS_m).mean() for name in ("A3", "A5", "B"))
    assert a5 >= a3
    assert a5 > b
    assert isolated_variance(0.005) > isolated_variance(0.003) > 1e-6


def test_contacts_that_enclose_nothing_explore_nothing() -> None:
    alone = ExploredMap.of(np.array([[0.0, 0.03]]), np.array([[0.0, 1.0]]))
    assert alone.explored_points("A3", TRUE_POINTS_m + 1.0).sum() == 0


def test_points_move_as_the_contacts_do() -> None:
    rng = np.random.default_rng(0)
    source = rng.normal(size=(8, 2))
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    target = source @ turn.T + [1.0, 2.0]
    assert moved_alike(np.array([[1.0, 0.0]]), source, target) == pytest.approx(np.array([[1.0, 3.0]]))


def moving_object(seed: int) -> MovingObject:
    """After five grasps that pushed it aside."""
    thing = MovingObject.track_by("joint", PlanarHand(OUTLINE_m, np.random.default_rng(seed)), seed)
    for palm in TEN_PALMS[:5]:
        thing.grasp(palm)
    return thing


def test_a_moving_object_is_followed_from_where_it_was_known_to_be() -> None:
    found = [moving_object(seed) for seed in (5, 6)]
    assert min(float(np.hypot(one.truth[-1].x(), one.truth[-1].y())) for one in found) > 0.005
    errors = [planar(one.truth[-1]).range(one.world_T_body.translation()) for one in found]
    assert max(errors) < 0.004


def test_what_is_known_of_a_moving_object_is_told_with_its_noise() -> None:
    thing = moving_object(5)
    laid_over = thing.in_map_frame(TRUE_POINTS_m)
    known = thing.map()
    assert known is not None
    assert np.linalg.norm(known.field.contacts_m[:, None] - laid_over[None], axis=-1).min(axis=1).max() < 0.01
    belief = thing.belief(known, np.random.default_rng(0))
    assert belief.latest_contacts.sum() == 5
    assert belief.particles.std(axis=0) == pytest.approx([0.01, 0.01, np.deg2rad(20)], rel=0.25)


def test_one_who_knows_all_beforehand_needs_fewer_grasps_than_chance() -> None:
    hand = PlanarHand(OUTLINE_m, np.random.default_rng(0))
    share = 0.5
    least = fewest_grasps(hand, TEN_PALMS, "B", TRUE_POINTS_m, share, 20)
    assert 4 <= least <= 6
    assert fewest_grasps(hand, TEN_PALMS, "B", TRUE_POINTS_m, 1.01, 3) == 3


def test_candidates_are_the_ten_or_a_hundred_of_the_seed() -> None:
    assert palms_called("10", 3) is TEN_PALMS
    assert palms_called("10 shifted", 3).shape == (70, 3)
    assert palms_called("100", 3) == pytest.approx(palms_called("100", 3))
    assert not np.allclose(palms_called("100", 3), palms_called("100", 4))


@pytest.mark.parametrize("policy", ["random", "information", INFORMED])
def test_a_run_that_is_cut_short_says_that_it_is_unfinished(policy: str) -> None:
    figures = explore_fixed(cell(policy=policy))
    assert figures["status"] == "not explored"
    assert figures["actions_B"] is None
    assert len(figures["decision_ms"]) == 4
    assert Row(cell(), figures).failure == "object not explored"
    if policy == "information":
        assert len(figures["promises"]) == 3
        assert all(0 < promised < 0.3 for promised, _ in figures["promises"])


def test_a_run_ends_when_both_definitions_are_met() -> None:
    figures = explore_fixed(cell(seed=2, policy="information", grasps=60))
    assert figures["status"] == "ok"
    assert 4 <= figures["actions_A"] < figures["actions_B"] < 30
    promised, realised = np.array(figures["promises"]).T
    assert abs(promised.sum() - realised.sum()) < 0.35 * realised.sum()


def test_the_same_cell_is_the_same_run() -> None:
    first, second = (explore_fixed(cell(seed=2, policy="information", grasps=3)) for _ in range(2))
    assert first["promises"] == second["promises"]


def test_a_moving_run_states_its_registration() -> None:
    figures = explore_moving(cell(policy="kl", grasps=3))
    assert figures["registration_mm"] < 5.0
    assert len(figures["decision_ms"]) == 3


def test_the_tables_hold_every_policy_and_the_bounds() -> None:
    fixed = {dict(setting)["policy"] for setting in fixed_settings(80)}
    assert {"random", "variance", "clusters", "entropy", "igef", "information", INFORMED, CLAIRVOYANT} <= fixed
    moving = {(dict(setting)["tracking"], dict(setting)["policy"]) for setting in moving_settings(80)}
    assert {("thesis-pf", "det"), ("thesis-pf", "random"), ("joint", "det"), ("joint", "kl")} <= moving
    assert ("joint", INFORMED) in moving


def test_promises_are_correlated_over_all_runs_and_means_have_their_error() -> None:
    rows = [
        Row(Cell((("policy", "x"),), seed), {"n": float(seed), "p": [[seed, 2.0 * seed], [seed + 0.5, 2.0 * seed + 1]]})
        for seed in (1, 2, 3)
    ]
    columns = (Column("n", "n", 1, kind="estimate"), Column("p", "p", 2, kind="correlation"))
    body = table([Group((("policy", "x"),), tuple(rows))], columns, {})[1]
    assert body[2:4] == ["2.0 ± 0.6", "1.00"]
    assert correlation([[0.0, 1.0], [1.0, 1.0], [2.0, 1.0]]) is None


def test_the_benchmark_of_decisions_names_every_policy() -> None:
    belief = box_belief(60)
    assert belief.surface is not None
    assert len(box_candidates()) == 72
    found = decision_table(60, ("random", "information"))
    assert [timing.name.split(":")[0] for timing in found.timings] == ["random", "information"]
    assert all(
        timing.ms > 0 and "72 candidates, 60 contacts, 5000 particles" in timing.note for timing in found.timings
    )
