"""Where fingers are expected over sampled worlds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose2

from tactile_lab.experiments.data.ray_casting import first_hits as plain_hits
from tactile_lab.experiments.data.solids import solid
from tactile_lab.slam.exploration.candidates import Candidate, ClosingRays, predict_contacts
from tactile_lab.slam.exploration.first_hits import first_hits
from tactile_lab.slam.exploration.prediction import (
    ExecutionNoise,
    expected_touches,
    nominal_world,
    possible_worlds,
    sampled_displacements,
)
from tactile_lab.slam.shape.fields.gpis import Gpis
from tests.support.rectangle_world import belief_of_right_end_unknown, modelled, ten, uncertain

POSE = Pose2(0.3, -0.2, 2.0)


def test_the_nominal_touches_are_those_on_the_field() -> None:
    belief = belief_of_right_end_unknown(POSE)
    assert belief.surface is not None
    touches = expected_touches(ten(POSE), belief, nominal_world(belief, belief.surface, 5))
    for candidate, points, met in zip(ten(POSE), touches.points_m, touches.touching, strict=True):
        expected = predict_contacts(candidate, modelled(belief)).points_object_m
        assert points[0][met[0]] == pytest.approx(expected, abs=1.5e-3)


@pytest.mark.parametrize("turn_rad", [0.0, 0.5, -0.8])
def test_balls_touch_a_long_side_beside_their_way(turn_rad: float) -> None:
    """Upward onto the lower side, at an angle: by ``radius * tan(angle)`` beside where the middle's way meets it."""
    belief, radius_m = belief_of_right_end_unknown(POSE), 0.008
    assert belief.surface is not None
    way = np.array([np.sin(turn_rad), np.cos(turn_rad), 0.0])
    start = np.array([-0.02, -0.03, 0.0]) - 0.06 * way
    points = {}
    for radius in (0.0, radius_m):
        ball = ClosingRays(("FF",), start[None], way[None], np.array([0.1]), radius)
        touches = expected_touches([Candidate(POSE, "one", ball)], belief, nominal_world(belief, belief.surface, 1))
        points[radius] = touches.points_m[0, 0, 0]
    assert points[0.0] == pytest.approx([-0.02, -0.03], abs=1.5e-3)
    aside_m = radius_m * np.tan(turn_rad)
    assert points[radius_m] == pytest.approx([-0.02 - aside_m, -0.03], abs=1.5e-3)


def test_balls_touch_where_they_meet_the_field() -> None:
    belief = belief_of_right_end_unknown(POSE)
    assert belief.surface is not None
    for candidate in ten(POSE):
        thick = replace(candidate, rays=replace(candidate.rays, radius_m=0.008))
        touches = expected_touches([thick], belief, nominal_world(belief, belief.surface, 5))
        expected = predict_contacts(thick, modelled(belief)).points_object_m
        met = touches.touching[0, 0]
        apart_m = np.linalg.norm(touches.points_m[0, 0][met] - expected, axis=1)
        assert np.median(apart_m) < 0.002
        assert apart_m.max() < 0.005  # around a corner the field is rounder than the surface moved outward


@pytest.mark.parametrize("name", ["l-block", "sphere"])
def test_compiled_hits_on_a_mesh_are_the_plain_ones(name: str) -> None:
    mesh = solid(name).mesh
    rng = np.random.default_rng(0)
    starts = rng.normal(size=(40, 3))
    starts *= 0.15 / np.linalg.norm(starts, axis=1, keepdims=True)
    ways = 0.02 * rng.normal(size=(40, 3)) - starts
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    expected, _ = plain_hits(np.asarray(mesh.triangles), starts, ways, 0.3)
    faces = np.asarray(mesh.faces, dtype=np.int64)
    found = first_hits(np.asarray(mesh.vertices)[None], faces, starts[None], ways[None], np.full(40, 0.3))
    assert np.isfinite(expected).sum() > 20
    assert found[0] == pytest.approx(np.asarray(expected), abs=1e-9)
    short = np.where(np.arange(40) % 2, np.asarray(expected) - 1e-6, 0.0)
    assert not np.isfinite(first_hits(np.asarray(mesh.vertices)[None], faces, starts[None], ways[None], short)).any()


def test_candidates_with_fewer_fingers_touch_with_fewer() -> None:
    belief = belief_of_right_end_unknown()
    assert belief.surface is not None
    full = ten()[0]
    thumb = ClosingRays(("TH",), full.rays.starts_m[4:], full.rays.directions[4:], full.rays.lengths_m[4:])
    both = [full, Candidate(full.world_T_grasp, "thumb", thumb)]
    touches = expected_touches(both, belief, nominal_world(belief, belief.surface, 5))
    assert touches.touching[1].sum() == 1
    assert touches.points_m[1, 0, 0] == pytest.approx(touches.points_m[0, 0, 4])


def test_worlds_spread_as_the_pose_and_the_execution_do() -> None:
    sigmas = np.array([0.01, 0.002, 0.2])
    belief = uncertain(belief_of_right_end_unknown(POSE), sigmas)
    assert belief.surface is not None
    noise = ExecutionNoise(palm_m=0.004, palm_rad=0.05, finger_m=0.001)
    worlds = possible_worlds(belief, belief.surface, 5, 4000, noise, np.random.default_rng(0))
    assert worlds.world_T_object.std(axis=0) == pytest.approx(sigmas, rel=0.12)
    assert worlds.palm_errors.std(axis=0) == pytest.approx([0.004, 0.004, 0.05], rel=0.1)
    gaussian = replace(belief, particles=np.empty((0, 3)), weights=np.empty(0))
    again = possible_worlds(gaussian, belief.surface, 5, 4000, noise, np.random.default_rng(0))
    assert again.world_T_object.std(axis=0) == pytest.approx(sigmas, rel=0.12)


def test_sampled_surfaces_stay_at_the_contacts_and_move_where_nothing_is_known() -> None:
    belief = belief_of_right_end_unknown()
    assert belief.surface is not None
    assert isinstance(belief.field, Gpis)
    moves = sampled_displacements(belief.field, belief.surface, 200, np.random.default_rng(0))
    assert moves.shape == (200, len(belief.surface.points_m))
    spread = moves.std(axis=0)
    assert spread == pytest.approx(belief.surface.sigma_m, rel=0.35, abs=2e-4)
    assert np.abs(moves).max() <= 0.015
    neighbours = np.corrcoef(moves[:, spread.argmax()], moves[:, spread.argmax() - 1])[0, 1]
    assert neighbours > 0.9
