"""The world marker's mean, and what happens when it or the camera is bumped."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.camera.calibration import CameraCalibration
from drivers.camera.markers import MarkerSettings
from drivers.camera.world_marker import WorldMarker
from drivers.core.contacts import Array

CAMERA = CameraCalibration(focal_px=(686.0, 687.0), centre_px=(322.8, 237.4), size_px=(640, 480))
CORNERS = np.array([[300.0, 200], [380, 200], [380, 280], [300, 280]])


def world(**changes: object) -> WorldMarker:
    return WorldMarker(CAMERA, MarkerSettings().model_copy(update=changes))


def noisy(count: int, shift: float = 0.0, seed: int = 0) -> list[Array]:
    rng = np.random.default_rng(seed)
    return [CORNERS + shift + 0.1 * rng.standard_normal((4, 2)) for _ in range(count)]


def test_a_marker_at_rest_is_averaged() -> None:
    marker = world()
    assert marker.camera_T_world() is None
    assert np.isnan(marker.reprojection_px())
    assert [marker.add(corners) for corners in noisy(200)] == [""] * 200
    assert marker.frames == 200
    np.testing.assert_allclose(marker.corners_px, CORNERS, atol=0.03)
    assert marker.reprojection_px() < 0.1


def test_one_picture_that_shows_it_elsewhere_is_refused_and_leaves_no_trace() -> None:
    marker = world()
    for corners in noisy(5):
        marker.add(corners)
    before = np.array(marker.corners_px)
    assert "px from its first position" in marker.add(CORNERS + 5.0)
    np.testing.assert_array_equal(marker.corners_px, before)
    assert marker.add(CORNERS) == ""
    assert marker.moved == ""


def test_a_bumped_marker_ends_the_truth_from_the_first_picture_on() -> None:
    marker = world()
    for corners in noisy(5):
        marker.add(corners)
    answers = [marker.add(corners) for corners in noisy(4, shift=5.0, seed=1)]
    assert all(answers)
    assert "moved" in answers[2]
    assert "moved" in answers[3]
    assert "moved" in marker.add(CORNERS), "nobody knows whether it came back to its place"
    assert marker.frames == 5


def test_pictures_that_disagree_with_each_other_are_no_motion() -> None:
    marker = world()
    marker.add(CORNERS)
    for shift in (5.0, -9.0, 20.0, -4.0):
        assert "px from its first position" in marker.add(CORNERS + shift)
    assert marker.moved == ""


def test_creeping_is_seen_though_no_step_is_large() -> None:
    marker, moved_at = world(), None
    for number, corners in enumerate(noisy(200)):
        if marker.add(corners + 0.02 * number):
            moved_at = number
            break
    assert moved_at is not None
    assert 20 <= moved_at < 60
    assert "drifts" in marker.moved


def test_a_marker_that_can_not_move_begins_a_new_mean_when_the_camera_did() -> None:
    marker = world(world_marker_fixed=True)
    for corners in noisy(5):
        marker.add(corners)
    answers = [bool(marker.add(corners)) for corners in noisy(6, shift=8.0, seed=1)]
    assert answers == [True, True, True, False, False, False]
    assert marker.frames == 4
    np.testing.assert_allclose(marker.corners_px, CORNERS + 8.0, atol=0.15)


@pytest.mark.parametrize("shift", [0.0, 0.5])
def test_the_pose_follows_the_mean(shift: float) -> None:
    marker = world()
    marker.add(CORNERS)
    first = marker.camera_T_world()
    marker.add(CORNERS + shift)
    second = marker.camera_T_world()
    assert first is not None
    assert second is not None
    assert first.equals(second, 1e-9) is (shift == 0.0)
