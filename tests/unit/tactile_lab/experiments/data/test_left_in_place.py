"""Simulated objects that nothing carries lie where they are, but for pushes that the hand's motion does not show."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose3

from drivers.core.errors import ConfigurationError
from drivers.core.poses import planar, transform_points
from tactile_lab.experiments.data.left_in_place import PUSHED_EVERY, simulate, simulate_thing
from tactile_lab.slam.shape.surfaces.sampling import distances_to_mesh, distances_to_polygon


def test_only_every_fourth_closing_moves_the_object_and_the_hand_says_that_none_did() -> None:
    data = simulate("L", 2, count=12)
    assert all(grasp.hand_motion_world.equals(Pose3(), 1e-12) for grasp in data.grasps)
    steps = [planar(one.between(other)) for one, other in zip(data.world_T_body, data.world_T_body[1:], strict=False)]
    pushed = [step for index, step in enumerate(steps, 1) if index % PUSHED_EVERY == PUSHED_EVERY - 1]
    crept = [step for index, step in enumerate(steps, 1) if index % PUSHED_EVERY != PUSHED_EVERY - 1]
    assert len(pushed) == 3
    assert max(abs(step.theta()) for step in crept) < np.deg2rad(1.2)
    assert max(abs(step.theta()) for step in pushed) > np.deg2rad(2.0)


def test_contacts_lie_on_the_object_where_it_is_and_every_grasp_touches_it() -> None:
    data = simulate("rectangle", 1, count=8)
    for grasp, pose in zip(data.grasps, data.world_T_body, strict=True):
        assert len(grasp.contacts) >= 3
        points_m = transform_points(pose.inverse(), grasp.points_world_m)[:, :2]
        assert distances_to_polygon(points_m, data.outline_m).max() < 0.005


def test_the_same_seed_gives_the_same_grasps_and_a_shape_that_there_is_not_is_refused() -> None:
    one, other = (simulate("ellipse", 4, count=3) for _ in range(2))
    assert all(
        np.array_equal(a.points_world_m, b.points_world_m) for a, b in zip(one.grasps, other.grasps, strict=True)
    )
    with pytest.raises(ConfigurationError, match="no planar shape 'blob'"):
        simulate("blob", 1)


def test_a_thing_stays_too_and_is_touched_over_its_height() -> None:
    data = simulate_thing("cup", 3, count=8)
    assert all(np.array_equal(grasp.hand_motion_world.matrix(), np.eye(4)) for grasp in data.grasps)
    steps = [planar(one.between(other)) for one, other in zip(data.world_T_body, data.world_T_body[1:], strict=False)]
    moved_m = [float(np.hypot(step.x(), step.y())) for step in steps]
    assert sorted(np.argsort(moved_m)[-2:] + 1) == [3, 7]
    heights_m = np.concatenate([grasp.points_world_m[:, 2] for grasp in data.grasps])
    assert heights_m.min() < 0.03
    assert heights_m.max() > 0.08
    for grasp, pose in zip(data.grasps, data.world_T_body, strict=True):
        assert distances_to_mesh(transform_points(pose.inverse(), grasp.points_world_m), data.mesh).max() < 0.005
