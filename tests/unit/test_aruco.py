"""Markers and object poses: photographs, and pictures drawn through a known camera."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from gtsam import Pose3, Rot3

from drivers.camera.aruco import FACE_DOWN, ObjectTracker, WorldMarker, fit_in_plane
from drivers.camera.calibration import CameraCalibration, load_camera
from drivers.camera.frames import Frame, Image, decode_image
from drivers.camera.glass import Glass
from drivers.camera.markers import MarkerSettings, detect, marker_corners, marker_poses
from drivers.fingertip import RigidTransform
from tactile_lab.geometry.contacts import Array
from tactile_lab.geometry.poses import rotation_angle_rad, transform_points

CAMERA = CameraCalibration(focal_px=(686.0, 687.0), centre_px=(322.8, 237.4), size_px=(640, 480))
WORLD_T_CAMERA = Pose3(Rot3.RzRyRx(0.07, -0.05, 0.02), np.array([0.05, 0.02, -0.45]))
SETTINGS = MarkerSettings(
    world_T_worldmarker=RigidTransform(translation_m=(0.125, 0.02, 0.0), rpy_rad=(np.pi, 0.0, 0.3)),
    object_T_objectmarker=RigidTransform(translation_m=(0.01, -0.005, -0.02), rpy_rad=(np.pi, 0.0, 0.5)),
)


def draw(markers: dict[int, tuple[Pose3, float]], seed: int = 0, noise: float = 3.0) -> Image:
    """A picture of markers (world pose and side), through the pinhole camera, with blur and noise."""
    finer = 4
    picture = np.full((480 * finer, 640 * finer), 150, np.uint8)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    for number, (world_T_marker, side_m) in markers.items():
        tile = cv2.copyMakeBorder(
            cv2.aruco.generateImageMarker(dictionary, number, 360), 60, 60, 60, 60, cv2.BORDER_CONSTANT, value=255
        )
        pose = (WORLD_T_CAMERA.inverse() * world_T_marker).matrix()
        corners = marker_corners(side_m * 480 / 360) @ pose[:3, :3].T + pose[:3, 3]
        target = (CAMERA.project(corners) + 0.5) * finer - 0.5
        source = np.array([[-0.5, -0.5], [479.5, -0.5], [479.5, 479.5], [-0.5, 479.5]])
        warp = cv2.getPerspectiveTransform(source.astype(np.float32), target.astype(np.float32))
        size = (640 * finer, 480 * finer)
        cover = cv2.warpPerspective(np.full_like(tile, 255), warp, size)
        picture = np.where(cover > 127, cv2.warpPerspective(tile, warp, size), picture)
    small = cv2.GaussianBlur(cv2.resize(picture, (640, 480), interpolation=cv2.INTER_AREA), (0, 0), 0.8)
    noisy = small + noise * np.random.default_rng(seed).standard_normal(small.shape)
    return np.asarray(np.clip(noisy, 0, 255), np.uint8)


def scene(
    x: float, y: float, yaw: float, seed: int = 0, *, side_m: float = SETTINGS.object_side_m, noise: float = 3.0
) -> tuple[Frame, Pose3]:
    """A frame with both markers, and where the object is: its marker lies on the table."""
    world_T_object = Pose3(Rot3.Yaw(yaw), np.array([x, y, 0.02]))
    markers = {
        0: (SETTINGS.world_T_worldmarker.pose(), SETTINGS.world_side_m),
        7: (world_T_object * SETTINGS.object_T_objectmarker.pose(), side_m),
    }
    return Frame(1000 + seed, draw(markers, seed, noise)), world_T_object


def errors(found: Pose3, truth: Pose3) -> tuple[float, float]:
    return float(np.linalg.norm(found.translation() - truth.translation())), rotation_angle_rad(truth.between(found))


def test_the_object_is_found_on_the_table_within_its_stated_error() -> None:
    tracker, distances, scores = ObjectTracker(CAMERA, SETTINGS), [], []
    rng = np.random.default_rng(5)
    for seed in range(12):
        x, y, yaw = rng.uniform(-0.08, 0.05), rng.uniform(-0.06, 0.06), rng.uniform(-np.pi, np.pi)
        frame, truth = scene(x, y, yaw, seed)
        sighting = tracker.object_pose(frame)
        assert sighting is not None
        distance, angle = errors(sighting.world_T_object, truth)
        distances.append(distance)
        scores.append(distance / sighting.position_sigma_m)
        assert angle < 4 * sighting.yaw_sigma_rad
        assert sighting.world_T_object.z() == pytest.approx(0.02, abs=1e-9)
        assert sighting.fit_rms_m < 5e-4
        assert sighting.stamp_ns == 1000 + seed
    assert np.median(distances) < 7e-4
    assert max(scores) < 5
    assert tracker.world.frames == 12
    assert tracker.world.reprojection_px() < 0.3


def test_detected_corners_are_unbiased_to_a_tenth_of_a_pixel() -> None:
    """Blur makes OpenCV's own refinement see squares too small; here they have their size."""
    outward, scatter = [], []
    for seed in range(6):
        pose = Pose3(Rot3.Yaw(0.3 + 0.5 * seed), np.array([0.02 * seed - 0.05, 0.01 * seed, 0.0])) * FACE_DOWN
        corners = transform_points(WORLD_T_CAMERA.inverse() * pose, marker_corners(0.035))
        truth = CAMERA.project(corners)
        error = detect(draw({7: (pose, 0.035)}, seed), "DICT_4X4_50")[7] - truth
        radial = truth - truth.mean(axis=0)
        outward.append(np.mean(np.sum(error * radial, axis=1) / np.linalg.norm(radial, axis=1)))
        scatter.append(np.sqrt(np.mean(error**2)))
    assert abs(np.mean(outward)) < 0.1
    assert max(scatter) < 0.15


def test_a_small_marker_alone_is_less_certain_and_says_so() -> None:
    tracker = ObjectTracker(CAMERA, SETTINGS.model_copy(update={"object_side_m": 0.018}))
    flagged, constrained, alone = 0, [], []
    for seed in range(8):
        frame, truth = scene(-0.02, 0.01, 0.8 * seed, seed, side_m=0.018, noise=8.0)
        sighting = tracker.object_pose(frame)
        assert sighting is not None
        assert len(sighting.unconstrained) == 2
        flagged += sighting.ambiguous
        constrained.append(errors(sighting.world_T_object, truth)[1])
        alone.append(errors(sighting.unconstrained[0], truth)[1])
    assert max(constrained) < np.median(alone)
    assert flagged > 0


def test_without_the_world_marker_there_is_no_pose_until_it_was_seen_once() -> None:
    tracker = ObjectTracker(CAMERA, SETTINGS)
    both, truth = scene(0.0, 0.0, 1.0)
    marker = truth * SETTINGS.object_T_objectmarker.pose()
    hidden = Frame(1, draw({7: (marker, SETTINGS.object_side_m)}))
    assert tracker.object_pose(hidden) is None
    assert tracker.object_pose(both) is not None
    sighting = tracker.object_pose(hidden)
    assert sighting is not None
    assert errors(sighting.world_T_object, truth)[0] < 1.5e-3
    assert tracker.object_pose(Frame(2, np.full((480, 640), 150, np.uint8))) is None


def test_a_marker_seen_twice_is_left_out() -> None:
    side = SETTINGS.object_side_m
    one, two = (Pose3(Rot3(), np.array([x, 0.0, 0.0])) * FACE_DOWN for x in (-0.06, 0.08))
    left, right = draw({7: (one, side)}), draw({7: (two, side)})
    assert set(detect(left, "DICT_4X4_50")) == {7}
    twice = np.where(np.abs(left.astype(int) - 150) > np.abs(right.astype(int) - 150), left, right)
    assert detect(twice.astype(np.uint8), "DICT_4X4_50") == {}


def test_the_world_markers_mean_begins_anew_when_it_jumps() -> None:
    world = WorldMarker(CAMERA, SETTINGS)
    assert world.camera_T_world() is None
    assert np.isnan(world.reprojection_px())
    corners = np.array([[300.0, 200], [380, 200], [380, 280], [300, 280]])
    for shift in (0.0, 0.5, 1.0):
        world.add(corners + shift)
    assert world.frames == 3
    np.testing.assert_allclose(world.corners_px, corners + 0.5)
    world.add(corners + 10)
    assert world.frames == 1


def test_a_square_is_laid_into_points_of_the_plane() -> None:
    model = np.array([[1.0, 1], [2, 1], [2, 3]])
    turn = np.array([[0.0, -1], [1, 0]])
    place, angle, misfit = fit_in_plane(model, model @ turn.T + [5.0, -2.0])
    np.testing.assert_allclose(place, [5, -2], atol=1e-12)
    assert angle == pytest.approx(np.pi / 2)
    assert misfit < 1e-12


def test_the_glass_moves_a_ray_as_snell_says() -> None:
    incidence = np.radians(20.0)
    refraction = np.arcsin(np.sin(incidence) / 1.5)
    glass = Glass(0.008, 1.5)
    shift = glass.shift(np.array([[np.tan(incidence), 0.0], [0.0, -np.tan(incidence)], [0.0, 0.0]]))
    expected = 0.008 * (np.tan(incidence) - np.tan(refraction))
    np.testing.assert_allclose(shift, [[expected, 0], [0, -expected], [0, 0]], atol=1e-12)
    np.testing.assert_array_equal(Glass().shift(np.ones((2, 2))), 0.0)


def test_corners_seen_through_glass_give_the_true_object_pose() -> None:
    """Exact pixels of points moved by the glass: the tracker undoes it for both markers."""
    settings = SETTINGS.model_copy(update={"glass_thickness_m": 0.008})
    truth, eye = Pose3(Rot3.Yaw(0.7), np.array([-0.05, 0.04, 0.02])), np.array(WORLD_T_CAMERA.translation())

    def pixels(world_T_marker: Pose3, side_m: float) -> Array:
        apparent = Glass(0.008).apparent(transform_points(world_T_marker, marker_corners(side_m)), eye)
        return CAMERA.project(transform_points(WORLD_T_CAMERA.inverse(), apparent))

    for thickness, largest_m in ((0.008, 1e-5), (0.0, 1e-3)):
        tracker = ObjectTracker(CAMERA, settings.model_copy(update={"glass_thickness_m": thickness}))
        tracker.world.add(pixels(settings.world_T_worldmarker.pose(), settings.world_side_m))
        sighting = tracker.sighting(1, pixels(truth * settings.object_T_objectmarker.pose(), settings.object_side_m))
        assert sighting is not None
        error = errors(sighting.world_T_object, truth)[0]
        assert error < largest_m
    assert error > 3e-5  # the glass left out: most of its effect the camera's pose takes up


def test_an_unknown_dictionary_is_refused() -> None:
    with pytest.raises(ValueError, match="DICT_3X3"):
        MarkerSettings(dictionary="DICT_3X3")


def _photo(folder: Path, name: str) -> Image:
    return decode_image((folder / name).read_bytes())


def test_the_photograph_gives_its_six_markers_in_front_of_the_camera(lab_data: Path) -> None:
    folder = lab_data / "aruco_photos"
    camera = load_camera(folder / "tutorial_camera_params.yml")
    found = detect(_photo(folder, "singlemarkersoriginal.jpg"), "DICT_6X6_250")
    assert sorted(found) == [23, 40, 62, 98, 124, 203]
    for corners in found.values():
        best, mirrored = marker_poses(corners, 0.05, camera)
        assert 0.3 < best.camera_T_marker.z() < 1.5
        assert best.reprojection_px < 0.4
        assert mirrored.reprojection_px > 2 * best.reprojection_px
    assert {number: _height(corners) for number, corners in found.items()}[40] < 60


def _height(corners: Array) -> float:
    return float(np.ptp(corners[:, 1]))


@pytest.mark.parametrize("name", ["choriginal.jpg", "img_00.jpg", "img_01.jpg"])
def test_charuco_boards_give_their_seventeen_markers_on_one_plane(lab_data: Path, name: str) -> None:
    folder = lab_data / "aruco_photos"
    camera = load_camera(folder / "tutorial_camera_charuco.yml")
    found = detect(_photo(folder, name), "DICT_6X6_250")
    assert sorted(found) == list(range(17))
    poses = [marker_poses(corners, 0.02, camera)[0] for corners in found.values()]
    centres = np.array([pose.camera_T_marker.translation() for pose in poses])
    assert centres[:, 2].min() > 0.05
    assert max(pose.reprojection_px for pose in poses) < 1.0
    flatness = np.linalg.svd(centres - centres.mean(axis=0))[1][2] / np.sqrt(len(centres))
    assert flatness < 0.01


def test_a_board_of_a_foreign_dictionary_gives_none(lab_data: Path) -> None:
    assert detect(_photo(lab_data / "aruco_photos", "gboriginal.png"), "DICT_6X6_250") == {}
