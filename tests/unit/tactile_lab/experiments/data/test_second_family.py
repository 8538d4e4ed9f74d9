"""The second family of simulated grasps: contacts on its bodies, errors of the stated size, heavy tails."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from drivers.core.errors import ConfigurationError
from drivers.core.poses import transform_points
from tactile_lab.experiments.data.second_family import SHAPES, POINT_SIGMA_m, body, simulate
from tactile_lab.slam.shape.surfaces.sampling import distances_to_polygon


@pytest.mark.parametrize("shape", SHAPES)
def test_bodies_are_closed_and_stand_on_the_table(shape: str) -> None:
    corners = body(shape).triangles_m
    mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    mesh.merge_vertices()
    assert mesh.is_watertight
    assert mesh.volume > 1e-4
    np.testing.assert_allclose(mesh.bounds[:, 2], [0.0, 0.09])


def test_contacts_are_on_the_outline_with_errors_of_the_stated_size_and_heavier_tails() -> None:
    errors_m = []
    for seed in range(12):
        data = simulate("t-block", seed, paths=False)
        for grasp, pose in zip(data.grasps, data.world_T_body, strict=True):
            points = transform_points(pose.inverse(), grasp.points_world_m)[:, :2]
            errors_m.append(distances_to_polygon(points, data.body.outline_m))
    found = np.concatenate(errors_m) / POINT_SIGMA_m
    assert 0.85 < np.sqrt(np.mean(found**2)) < 1.15
    assert np.mean(found > 3.3) > 0.003  # a normal distribution has a thousandth


def outside_m(shape: str, seed: int) -> float:
    """How far outside of a convex outline the contacts of a session lie on average."""
    data, found = simulate(shape, seed), []
    start = data.body.outline_m
    along = np.roll(start, -1, axis=0) - start
    outward = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)
    for grasp, pose in zip(data.grasps, data.world_T_body, strict=True):
        points = transform_points(pose.inverse(), grasp.points_world_m)[:, :2]
        found.append(np.einsum("pkd,kd->pk", points[:, None] - start, outward).max(axis=1))
    return float(np.concatenate(found).mean())


def test_the_bias_of_a_session_is_drawn_as_its_contacts_state_it() -> None:
    sessions = [("octagonal-prism", seed) for seed in range(24)] + [("tapered-cup", seed) for seed in range(24)]
    found = np.array([outside_m(*session) for session in sessions])
    shared = simulate("tapered-cup", 0, count=1).grasps[0].contacts[0].shared_covariance_m2
    assert shared is not None
    stated = np.sqrt(shared[0, 0])
    assert abs(found.mean()) < 0.5 * stated
    assert 0.8 * stated < found.std() < 1.7 * stated  # contacts scatter besides


def test_solids_are_touched_at_all_heights_and_on_top() -> None:
    data = simulate("tapered-cup", 3, dimension=3, count=12)
    heights_m = np.concatenate([grasp.points_world_m[:, 2] for grasp in data.grasps])
    assert heights_m.min() < 0.03
    assert np.mean(heights_m > 0.086) > 0.1
    assert data.grasps[0].approach_paths


def test_the_same_seed_gives_the_same_grasps_and_an_unknown_shape_is_refused() -> None:
    one, two = (simulate("wedge", 5, count=3, wrong_share=0.1) for _ in range(2))
    np.testing.assert_array_equal(one.grasps[2].points_world_m, two.grasps[2].points_world_m)
    with pytest.raises(ConfigurationError, match="second family"):
        simulate("teapot", 0)
