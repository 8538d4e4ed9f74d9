"""The object under an alternative to the estimate."""

from __future__ import annotations

import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.poses import planar
from tactile_lab.autonomy.rival_objects import rival_objects
from tactile_lab.autonomy.variance_planner import ExplorationSettings
from tactile_lab.experiments.data.planar_data import simulate
from tactile_lab.slam.doubt.status import Alternative
from tactile_lab.slam.tactile_slam import TactileSlam


def test_an_alternative_has_the_pose_and_the_outline_that_its_last_grasp_gives() -> None:
    slam = TactileSlam(seed=0)
    for grasp in simulate("rectangle", 50, count=4).grasps:
        slam.add_grasp(grasp)
    now = slam.world_T_object
    assert now is not None
    turned = now * Pose3(Rot3.Rz(0.5), np.array([0.02, 0.0, 0.0]))
    other = Alternative((3,), (turned,), 0.2, 0.5, 0.03, 0.01)
    carried = Pose3(Rot3(), np.array([0.1, 0.0, 0.0]))
    settings = ExplorationSettings()
    assert rival_objects(slam, (), carried, settings) == ()
    (found,) = rival_objects(slam, (other,), carried, settings)
    assert found.world_T_object.equals(planar(carried * turned), 1e-9)
    assert (found.probability, found.displaced) == (0.2, 5)
    apart = (
        slam.displaced(other).contacts.points_m[-5:]
        - slam.displaced(Alternative((3,), (now,), 0.2, 0.0, 0.0, 0.0)).contacts.points_m[-5:]
    )
    assert np.linalg.norm(apart, axis=1).min() > 0.005
    assert len(rival_objects(slam, (other, other, other), carried, settings)) == 2
