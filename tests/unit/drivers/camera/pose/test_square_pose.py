"""A lens's projection and the poses of a square, against OpenCV's."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from gtsam import Pose3, Rot3

from drivers.camera.calibration import CameraCalibration
from drivers.camera.markers import MARKER_COUNTS, marker_corners
from drivers.camera.pose.square_pose import marker_poses, points_reprojection_px, refine_pose
from drivers.core.contacts import Array
from drivers.core.poses import transform_points

COEFFICIENTS = (-0.12, 0.06, 8e-4, -6e-4, 0.01, 0.02, -0.01, 0.003, 1e-3, -5e-4, 2e-4, 3e-4, 0.02, -0.015)
SIDE_m = 0.035


def lens(coefficients: int) -> CameraCalibration:
    return CameraCalibration(focal_px=(686.0, 687.0), centre_px=(322.8, 237.4), distortion=COEFFICIENTS[:coefficients])


def pose_of(rotation_vector: Array, translation: Array) -> Pose3:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = cv2.Rodrigues(rotation_vector)[0], np.ravel(translation)
    return Pose3(matrix)


def seen_squares(camera: CameraCalibration) -> list[Array]:
    """Corners of squares before the camera, each an error of a tenth of a pixel away."""
    rng, found = np.random.default_rng(5), []
    for _ in range(40):
        turn = Rot3.Expmap(np.array([np.pi, 0.0, 0.0])) * Rot3.Expmap(rng.normal(0.0, 0.3, 3))
        pose = Pose3(turn, np.array([*rng.uniform(-0.1, 0.1, 2), rng.uniform(0.3, 0.6)]))
        corners = camera.project(transform_points(pose, marker_corners(SIDE_m)))
        found.append(corners + rng.normal(0.0, 0.1, (4, 2)))
    return found


def test_the_dictionaries_are_opencvs_in_its_order() -> None:
    names = [name for name in dir(cv2.aruco) if name.startswith("DICT_")]
    assert list(MARKER_COUNTS) == sorted(names, key=lambda name: int(getattr(cv2.aruco, name)))
    for name, count in MARKER_COUNTS.items():
        assert len(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name)).bytesList) == count


@pytest.mark.parametrize("coefficients", [0, 4, 5, 8, 12, 14])
def test_points_pixels_and_derivatives_are_opencvs(coefficients: int) -> None:
    camera, rng = lens(coefficients), np.random.default_rng(3)
    points = np.column_stack([rng.uniform(-0.2, 0.2, 50), rng.uniform(-0.15, 0.15, 50), rng.uniform(0.4, 0.6, 50)])
    parameters = camera.matrix, camera.distortion_coefficients
    expected, slopes = cv2.projectPoints(points, np.zeros(3), np.zeros(3), *parameters)
    pixels, by_place = camera.projection(points)
    np.testing.assert_allclose(pixels, expected[:, 0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(by_place, slopes[:, 3:6].reshape(-1, 2, 3), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(camera.project(points), pixels, rtol=0, atol=1e-12)
    np.testing.assert_allclose(camera.rays(pixels), points / points[:, 2:], rtol=0, atol=1e-9)


@pytest.mark.parametrize("coefficients", [0, 5, 14])
def test_both_poses_of_a_square_are_opencvs(coefficients: int) -> None:
    camera = lens(coefficients)
    parameters = camera.matrix, camera.distortion_coefficients
    for corners in seen_squares(camera):
        found = [each.camera_T_marker for each in marker_poses(corners, SIDE_m, camera)]
        _, turns, places, _ = cv2.solvePnPGeneric(
            marker_corners(SIDE_m), corners, *parameters, flags=cv2.SOLVEPNP_IPPE_SQUARE
        )
        for expected in map(pose_of, turns, places):
            assert min(np.linalg.norm(Pose3.Logmap(expected.between(pose))) for pose in found) < 1e-6


def test_a_refined_pose_fits_as_well_as_opencvs() -> None:
    camera, corners_m = lens(5), marker_corners(SIDE_m)
    for corners in seen_squares(camera):
        start = marker_poses(corners, SIDE_m, camera)[0].camera_T_marker
        turn, place = cv2.Rodrigues(start.rotation().matrix())[0], np.array(start.translation()).reshape(3, 1)
        parameters = camera.matrix, camera.distortion_coefficients
        expected = pose_of(*cv2.solvePnPRefineLM(corners_m, corners, *parameters, turn, place))
        found = refine_pose(start, corners_m, corners, camera)
        misfits = [points_reprojection_px(pose, corners_m, corners, camera) for pose in (found, expected)]
        assert misfits[0] <= misfits[1] + 1e-9
        assert np.linalg.norm(Pose3.Logmap(expected.between(found))) < 1e-4


@pytest.mark.parametrize("corners", [np.full((4, 2), 100.0), 100.0 * np.arange(4.0)[:, None] * np.ones(2)])
def test_corners_in_one_point_or_line_fit_badly(corners: Array) -> None:
    assert marker_poses(corners, SIDE_m, lens(5))[0].reprojection_px > 10.0
