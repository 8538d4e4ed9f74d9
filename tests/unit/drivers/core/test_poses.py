from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose2, Pose3, Rot3
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.contacts import Contact, Grasp
from drivers.core.poses import planar, rotate, rotation_angle_rad, spatial, transform_points, wrap_angle_rad

lengths_m = st.floats(-2.0, 2.0)
angles_rad = st.floats(-3.1, 3.1)
planar_poses = st.builds(Pose2, lengths_m, lengths_m, angles_rad)
spatial_poses = st.builds(
    lambda roll, pitch, yaw, x, y, z: Pose3(Rot3.Ypr(yaw, pitch, roll), np.array([x, y, z])),
    angles_rad, st.floats(-1.5, 1.5), angles_rad, lengths_m, lengths_m, lengths_m,
)  # fmt: skip
quick = settings(max_examples=50, derandomize=True, deadline=None)


@quick
@given(pose=planar_poses, height_m=lengths_m)
def test_a_planar_pose_survives_the_way_into_space_and_back(pose, height_m):
    lifted = spatial(pose, height_m)
    assert lifted.z() == pytest.approx(height_m)
    assert planar(lifted).equals(pose, 1e-9)


@quick
@given(one=planar_poses, other=planar_poses)
def test_lifting_keeps_composition(one, other):
    assert spatial(one * other).equals(spatial(one) * spatial(other), 1e-9)


@quick
@given(yaw=angles_rad, tilt=st.floats(-0.3, 0.3), direction=angles_rad)
def test_the_planar_rotation_is_the_one_nearest_to_a_tilted_one(yaw, tilt, direction):
    axis = np.array([np.cos(direction), np.sin(direction), 0.0])
    tilted = Rot3.Expmap(tilt * axis) * Rot3.Yaw(yaw)

    def distance(angle):
        return np.linalg.norm(tilted.matrix() - Rot3.Yaw(angle).matrix())

    found = planar(Pose3(tilted, np.zeros(3))).theta()
    assert all(distance(found) <= distance(found + step) + 1e-12 for step in (-0.01, 0.01))


@quick
@given(pose=spatial_poses, other=spatial_poses)
def test_points_and_directions_follow_the_pose(pose, other):
    points_m = np.array([[0.0, 0.0, 0.0], [0.1, -0.2, 0.3], [1.0, 1.0, 1.0]])
    expected_m = np.array([pose.transformFrom(point) for point in points_m])
    np.testing.assert_allclose(transform_points(pose, points_m), expected_m, atol=1e-12)
    np.testing.assert_allclose(
        transform_points(pose * other, points_m), transform_points(pose, transform_points(other, points_m)), atol=1e-9
    )
    differences = rotate(pose, points_m[1:] - points_m[0])
    np.testing.assert_allclose(differences, expected_m[1:] - expected_m[0], atol=1e-9)


def test_no_points_stay_no_points():
    assert transform_points(Pose3(), np.zeros((0, 3))).shape == (0, 3)


@pytest.mark.parametrize("angle_rad", [0.0, 0.5, 3.0])
def test_the_angle_of_a_rotation_is_positive(angle_rad):
    for sign in (-1, 1):
        pose = Pose3(Rot3.Rx(sign * angle_rad), np.ones(3))
        assert rotation_angle_rad(pose) == pytest.approx(angle_rad)


@quick
@given(angle_rad=st.floats(-100.0, 100.0))
def test_wrapped_angles_are_the_same_direction_within_half_a_turn(angle_rad):
    wrapped = float(wrap_angle_rad(angle_rad))
    assert -np.pi <= wrapped < np.pi + 1e-12
    assert np.cos(wrapped - angle_rad) == pytest.approx(1.0)


def test_a_grasp_gives_its_contacts_as_arrays():
    contacts = tuple(
        Contact(finger, np.full(3, number), np.eye(3)[number], np.eye(3), 0.1, 1.0)
        for number, finger in enumerate(("FF", "TH"))
    )
    grasp = Grasp(0, 0, contacts, Pose3())
    np.testing.assert_array_equal(grasp.points_world_m, [[0, 0, 0], [1, 1, 1]])
    np.testing.assert_array_equal(grasp.normals_world, [[1, 0, 0], [0, 1, 0]])
    assert Grasp(0, 0, (), Pose3()).points_world_m.shape == (0, 3)
    assert grasp.hand_motion_world.equals(Pose3(), 0.0)
