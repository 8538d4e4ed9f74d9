"""Markers and object poses: photographs, and pictures drawn through a known camera."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from gtsam import Pose3, Rot3

from drivers.camera.aruco import FACE_DOWN, ObjectTracker, fit_in_plane, is_ambiguous
from drivers.camera.calibration import CameraCalibration, load_camera
from drivers.camera.detection import detect, detection, other_dictionary
from drivers.camera.frames import Detection, Frame, Image, decode_image
from drivers.camera.glass import Glass
from drivers.camera.markers import MarkerSettings, marker_corners
from drivers.camera.pose.square_pose import MarkerPose, marker_poses
from drivers.core.contacts import Array
from drivers.core.fingertip import RigidTransform
from drivers.core.poses import rotation_angle_rad, transform_points

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
        low = np.clip(np.floor(target.min(axis=0)) - 2, 0, None).astype(int)
        high = np.clip(np.ceil(target.max(axis=0)) + 3, None, (640 * finer, 480 * finer)).astype(int)
        warp = cv2.getPerspectiveTransform(source.astype(np.float32), (target - low).astype(np.float32))
        part = picture[low[1] : high[1], low[0] : high[0]]
        cover = cv2.warpPerspective(np.full_like(tile, 255), warp, part.shape[::-1])
        part[:] = np.where(cover > 127, cv2.warpPerspective(tile, warp, part.shape[::-1]), part)
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
        sighting = tracker.observe(frame).sighting
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


def test_detected_corners_are_unbiased_to_a_few_hundredths_of_a_pixel() -> None:
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
    assert abs(np.mean(outward)) < 0.04
    assert max(scatter) < 0.1


def test_a_small_marker_alone_is_less_certain_and_says_so() -> None:
    tracker = ObjectTracker(CAMERA, SETTINGS.model_copy(update={"object_side_m": 0.018}))
    flagged, constrained, alone = 0, [], []
    for seed in range(8):
        frame, truth = scene(-0.02, 0.01, 0.8 * seed, seed, side_m=0.018, noise=8.0)
        sighting = tracker.observe(frame).sighting
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
    assert tracker.observe(hidden).sighting is None
    assert tracker.observe(both).sighting is not None
    sighting = tracker.observe(hidden).sighting
    assert sighting is not None
    assert errors(sighting.world_T_object, truth)[0] < 1.5e-3
    assert tracker.observe(Frame(2, np.full((480, 640), 150, np.uint8))).sighting is None


def test_a_marker_seen_twice_is_left_out() -> None:
    side = SETTINGS.object_side_m
    one, two = (Pose3(Rot3(), np.array([x, 0.0, 0.0])) * FACE_DOWN for x in (-0.06, 0.08))
    left, right = draw({7: (one, side)}), draw({7: (two, side)})
    assert set(detect(left, "DICT_4X4_50")) == {7}
    twice = np.where(np.abs(left.astype(int) - 150) > np.abs(right.astype(int) - 150), left, right)
    assert detect(twice.astype(np.uint8), "DICT_4X4_50") == {}


def test_a_second_pose_is_ruled_out_only_above_the_corners_noise() -> None:
    def poses(*errors_px: float) -> tuple[MarkerPose, ...]:
        return tuple(MarkerPose(Pose3(), error) for error in errors_px)

    assert not is_ambiguous(poses(0.2), 0.1, 4.0)
    assert is_ambiguous(poses(0.01, 0.19), 0.1, 4.0)
    assert not is_ambiguous(poses(0.01, 0.22), 0.1, 4.0)
    assert is_ambiguous(poses(0.01, 0.22), 0.1, 5.0)
    assert is_ambiguous(poses(0.2, 0.5), 0.1, 4.0)  # the better pose leaves more over than the noise would
    assert not is_ambiguous(poses(0.2, 0.7), 0.1, 4.0)


def test_noise_does_not_make_the_wrong_pose_the_clearly_better_one() -> None:
    """At the worst tilts, nearly face-on: the surer it has to be the fewer are wrong, and of the clear ones none."""
    rng, wrong, clear = np.random.default_rng(5), {2.0: 0, 5.0: 0}, {2.0: 0, 5.0: 0}
    for _ in range(1000):
        tilt = np.radians(rng.uniform(2.0, 8.0))
        truth = Pose3(Rot3.RzRyRx(np.pi + tilt, 0.0, rng.uniform(-3, 3)), np.array([0.0, 0.0, 0.5]))
        exact = CAMERA.project(transform_points(truth, marker_corners(0.035)))
        found = marker_poses(exact + 0.1 * rng.standard_normal((4, 2)), 0.035, CAMERA)
        errors_rad = [rotation_angle_rad(truth.between(each.camera_T_marker)) for each in found]
        for sigmas in clear:
            if not is_ambiguous(found, 0.1, sigmas):
                clear[sigmas] += 1
                wrong[sigmas] += errors_rad[0] > errors_rad[1]
    assert clear[2.0] > 333
    assert clear[5.0] > 13
    assert 0 < wrong[2.0] < 0.05 * 1000
    assert wrong[5.0] == 0


def test_a_free_object_is_told_only_where_its_marker_allows_one_pose() -> None:
    """Seen from far away a square allows two poses: such a picture is refused and says why."""
    free = SETTINGS.model_copy(update={"freedom": "spatial", "object_side_m": 0.02})
    tracker, valid, refused = ObjectTracker(CAMERA, free), [], []
    for seed in range(6):
        frame, truth = scene(-0.03, 0.01, 0.7 * seed, seed, side_m=0.02)
        seen = tracker.observe(frame)
        if seen.sighting is None:
            refused.append(seen.problem)
        else:
            valid.append(errors(seen.sighting.world_T_object, truth)[1])
            assert seen.sighting.covariance.shape == (6, 6)
    assert refused
    assert all(problem.startswith("ambiguous: the marker allows two poses") for problem in refused)
    assert all(angle < np.radians(10) for angle in valid)


def test_the_stated_covariance_is_that_of_the_corners_noise() -> None:
    """Exact corners plus noise, again and again: the spread of x, y and yaw is the stated one."""
    settings = SETTINGS.model_copy(update={"table_sigma_m": 0.0, "table_sigma_rad": 0.0, "corner_sigma_px": 0.3})
    truth, rng = Pose3(Rot3.Yaw(0.7), np.array([-0.05, 0.04, 0.02])), np.random.default_rng(3)
    world = CAMERA.project(
        transform_points(WORLD_T_CAMERA.inverse() * settings.world_T_worldmarker.pose(), settings.world_corners_m)
    )
    marker = WORLD_T_CAMERA.inverse() * truth * settings.object_T_objectmarker.pose()
    exact = CAMERA.project(transform_points(marker, settings.object_corners_m))
    changes, stated = [], np.zeros((3, 3))
    for _ in range(150):
        tracker = ObjectTracker(CAMERA, settings)
        tracker.world.add(world + 0.3 * rng.standard_normal((4, 2)))
        sighting = tracker.sighting(1, exact + 0.3 * rng.standard_normal((4, 2)))
        assert sighting is not None
        pose = sighting.world_T_object
        changes.append([pose.x() - truth.x(), pose.y() - truth.y(), pose.rotation().yaw() - 0.7])
        stated = sighting.covariance
    found = np.cov(np.array(changes).T)
    ratio = np.sqrt(np.diag(found) / np.diag(stated))
    assert np.all((ratio > 0.8) & (ratio < 1.4)), ratio


def test_a_print_that_is_smaller_than_meant_is_measured_with_its_true_size() -> None:
    small = SETTINGS.model_copy(update={"print_scale": 0.995})
    np.testing.assert_allclose(np.linalg.norm(np.diff(small.object_corners_m, axis=0), axis=1), 0.995 * 0.035)
    with pytest.raises(ValueError, match="print_scale"):
        MarkerSettings(print_scale=0.99)


def refused(tracker: ObjectTracker, frame: Frame) -> str:
    seen = tracker.observe(frame)
    assert seen.sighting is None
    return seen.problem


def test_a_picture_of_another_size_than_the_lens_was_calibrated_with_is_refused() -> None:
    frame, _ = scene(0.0, 0.0, 0.3)
    assert frame.image is not None
    smaller = Frame(1, np.asarray(cv2.resize(frame.image, (320, 240)), np.uint8))
    problem = refused(ObjectTracker(CAMERA, SETTINGS), smaller)
    assert problem == "the picture has 320 x 240 pixels, but the lens was calibrated with 640 x 480"


def test_a_blurred_picture_is_refused() -> None:
    frame, _ = scene(0.0, 0.0, 0.3)
    assert frame.image is not None
    streak = np.zeros((9, 9))
    streak[4] = 1 / 9
    tracker = ObjectTracker(CAMERA, SETTINGS)
    assert tracker.observe(frame).sighting is not None
    problem = refused(tracker, Frame(1, np.asarray(cv2.filter2D(frame.image, -1, streak), np.uint8)))
    assert problem.startswith("blurred: the edges of marker")
    assert tracker.world.frames == 1


def test_a_marker_whose_edges_are_not_found_is_not_called_blurred() -> None:
    frame, _ = scene(0.0, 0.0, 0.3)
    assert frame.image is not None
    found = detection(frame.image, "DICT_4X4_50")
    lost = {7: replace(found.markers[7], blur_px=np.inf)}
    problem = refused(
        ObjectTracker(CAMERA, SETTINGS), Frame(1, None, detection=replace(found, markers={**found.markers, **lost}))
    )
    assert problem == "the edges of marker 7 cannot be measured: it may be partly covered, in glare, or too small"


def test_a_lifted_object_is_refused() -> None:
    _, truth = scene(0.0, 0.0, 0.3)
    high = Pose3(Rot3(), np.array([0.0, 0.0, 0.06])) * truth * SETTINGS.object_T_objectmarker.pose()
    picture = draw({0: (SETTINGS.world_T_worldmarker.pose(), SETTINGS.world_side_m), 7: (high, SETTINGS.object_side_m)})
    problem = refused(ObjectTracker(CAMERA, SETTINGS), Frame(1, picture))
    assert "does not lie flat on the table" in problem


def test_corners_of_another_dictionary_are_refused() -> None:
    frame, _ = scene(0.0, 0.0, 0.3)
    assert frame.image is not None
    found = Detection("DICT_5X5_50", (640, 480), detection(frame.image, "DICT_4X4_50").markers)
    problem = refused(ObjectTracker(CAMERA, SETTINGS), Frame(1, None, detection=found))
    assert problem == "markers of DICT_5X5_50 were detected, not of DICT_4X4_50"


def test_recorded_corners_give_the_same_pose_as_the_picture() -> None:
    frame, _ = scene(0.01, -0.02, 0.9)
    assert frame.image is not None
    corners = Frame(frame.stamp_ns, None, detection=detection(frame.image, "DICT_4X4_50"))
    one, other = (ObjectTracker(CAMERA, SETTINGS).observe(each).sighting for each in (frame, corners))
    assert one is not None
    assert other is not None
    assert one.world_T_object.equals(other.world_T_object, 1e-12)


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

    found_m = []
    for thickness in (0.008, 0.0):
        tracker = ObjectTracker(CAMERA, settings.model_copy(update={"glass_thickness_m": thickness}))
        tracker.world.add(pixels(settings.world_T_worldmarker.pose(), settings.world_side_m))
        sighting = tracker.sighting(1, pixels(truth * settings.object_T_objectmarker.pose(), settings.object_side_m))
        assert sighting is not None
        found_m.append(errors(sighting.world_T_object, truth)[0])
    with_glass_m, without_m = found_m
    assert with_glass_m < 5e-6
    assert 1e-5 < without_m < 1e-3, "most of its effect the camera's pose takes up"


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


def test_a_wrong_dictionary_gives_nothing_and_the_right_one_is_named(lab_data: Path) -> None:
    folder = lab_data / "aruco_photos"
    assert detect(_photo(folder, "gboriginal.png"), "DICT_6X6_250") == {}
    assert detect(_photo(folder, "choriginal.jpg"), "DICT_5X5_250") == {}
    assert other_dictionary(_photo(folder, "choriginal.jpg"), "DICT_5X5_250") == "DICT_6X6_1000"
    assert other_dictionary(_photo(folder, "gboriginal.png"), "DICT_6X6_250") is None
