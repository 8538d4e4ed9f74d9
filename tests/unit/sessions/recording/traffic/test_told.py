"""What messages tell is what was recorded, and a message that is not as described is refused."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose2

from drivers.core.poses import spatial
from sessions.recording.traffic import foxglove, told

CONTACT = {
    "finger": "FF",
    "point_world_m": [0.1, -0.2, 0.03],
    "normal_world": [0.0, 1.0, 0.0],
    "point_covariance_m2": [[1e-6, 0.0, 0.0], [0.0, 1e-6, 0.0], [0.0, 0.0, 1e-6]],
    "force_N": 0.4,
}


def test_a_pose_and_its_stamp_come_back() -> None:
    pose = spatial(Pose2(0.4, -0.1, 0.7), 0.02)
    content = {"timestamp": foxglove.time(3_000_000_007), "pose": foxglove.pose(pose)}
    assert told.pose(content).equals(pose, 1e-12)
    assert told.stamp_ns(content) == 3_000_000_007


def test_a_grasp_has_its_contacts_and_may_have_none() -> None:
    index, (touch,) = told.grasp({"index": 4, "contacts": [CONTACT]})
    assert (index, touch.finger, touch.force_N) == (4, "FF", 0.4)
    assert touch.point_world_m.shape == touch.normal_world.shape == (3,)
    assert touch.covariance_m2.shape == (3, 3)
    assert told.grasp({"index": 0, "contacts": []}) == (0, ())


def test_no_surface_has_no_vertices() -> None:
    empty = {"dimension": 3, "vertices_m": [], "faces": [], "sigma_m": [], "explored": 0.0, "origin_height_m": 0.01}
    found = told.surface(empty)
    assert found.vertices_m.shape == found.faces.shape == (0, 3)
    assert found.origin_height_m == 0.01


def test_an_estimate_may_have_no_covariance() -> None:
    assert told.covariance({}) is None
    assert told.covariance({"covariance": None}) is None
    assert np.array_equal(told.covariance({"covariance": np.eye(3).tolist()}), np.eye(3))


@pytest.mark.parametrize("missing", sorted(CONTACT))
def test_a_contact_without_one_of_its_values_is_refused(missing: str) -> None:
    less = {name: value for name, value in CONTACT.items() if name != missing}
    with pytest.raises(KeyError, match=missing):
        told.grasp({"index": 0, "contacts": [less]})
