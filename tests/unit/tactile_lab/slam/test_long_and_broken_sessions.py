"""Sessions that are long, that lose the object, or that move it freely in space."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose3, Rot3

from tactile_lab.experiments.data import planar_data, spatial_data
from tactile_lab.experiments.data.carried_off import carried_off
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tests.support.simulated_contacts import registration_mm


@pytest.mark.parametrize("shape", ["rectangle", pytest.param("hexagon", marks=pytest.mark.long)])
def test_an_object_that_was_carried_off_is_found_again(shape: str) -> None:
    jump = Pose3(Rot3.Rz(1.0), np.array([0.1, 0.02, 0.0]))
    data = carried_off(planar_data.simulate(shape, 2, count=9), 6, jump)
    slam = TactileSlam(SlamSettings.model_validate({"joint": {"backwards": False}}), 0)
    for grasp in data.grasps:
        slam.add_grasp(grasp)
    result = slam.finish()
    assert registration_mm(data, result) < 4.0
    assert result.status != "lost"


def test_a_long_session_is_summed_up_and_ends_with_all_its_poses() -> None:
    data = planar_data.simulate("rectangle", 3, count=10, motion_scale=0.5)
    joint = {"window": 4, "remembered": 20, "hypotheses": 2, "smoothed": 3}
    slam = TactileSlam(SlamSettings.model_validate({"joint": joint}), 0)
    for grasp in data.grasps:
        slam.add_grasp(grasp)
    result = slam.finish()
    assert len(result.world_T_object) == 10
    assert registration_mm(data, result) < 4.0


@pytest.mark.long
def test_an_object_held_free_in_space_is_followed() -> None:
    data = spatial_data.simulate("box-12x6x6", 0, motion="free", motion_scale=0.5, count=8)
    motion = {"translation_m": 0.005, "rotation_rad": float(np.deg2rad(10))}
    joint = {"hypotheses": 2, "smoothed": 3, "backwards": False}
    settings = {"dimension": 3, "freedom": "space", "motion": motion, "joint": joint, "mesh_resolution_m": 0.006}
    slam = TactileSlam(SlamSettings.model_validate(settings), 0)
    odometry = TactileSlam(SlamSettings.model_validate({**settings, "method": "odometry"}), 0)
    for grasp in data.grasps:
        slam.add_grasp(grasp)
        odometry.add_grasp(grasp)
    assert registration_mm(data, slam.finish()) < 0.6 * registration_mm(data, odometry.finish())
    covariance = slam.pose_covariance
    assert covariance is not None
    assert covariance.shape == (6, 6)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"dimension": 2, "freedom": "space"}, "needs dimension 3"),
        ({"dimension": 3, "freedom": "space", "method": "particle"}, "on a table only"),
    ],
)
def test_freedom_in_space_is_refused_where_it_means_nothing(changes: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        SlamSettings.model_validate(changes)


def test_the_noise_of_the_motion_may_be_learnt_while_tracking() -> None:
    data = planar_data.simulate("rectangle", 3, count=8, motion_scale=0.2)
    slam = TactileSlam(SlamSettings.model_validate({"joint": {"estimate_motion": True, "backwards": False}}), 0)
    for grasp in data.grasps:
        slam.add_grasp(grasp)
    assert registration_mm(data, slam.finish()) < 4.0
