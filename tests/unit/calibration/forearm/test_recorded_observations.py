"""Recorded touches and pictures: each comes back as it was, and one that cannot be used is refused by name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gtsam import Pose3, Rot3

from calibration.forearm.recordings import ForearmData, load_data, save_data
from calibration.forearm.touch_plan import plan_touches
from calibration.forearm.view_plan import PlannedView
from calibration.forearm.wizard import WizardSettings, problem_of, solving_steps
from calibration.steps.geometry import KnownGeometry, patches
from calibration.steps.observations import HandPose, PosePair, Spot, Touch, View
from drivers.camera.calibration import CameraCalibration
from drivers.camera.markers import MarkerSettings
from drivers.core.errors import ConfigurationError

STILL = HandPose(np.zeros(6), np.zeros(24))
SPOT = Spot("corner", np.array([0.1, 0.2, 0.3]), 0.0004)
TOUCH = Touch("MF", STILL, np.array([0.0, 0.001, 0.02]), np.array([0.0, 0.0, 1.0]), 1e-8 * np.eye(3), SPOT, 1.5)
SQUARE = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0], [0.0, 0.1, 0.0]])
VIEW = View(pose=STILL, board_m=SQUARE, board_px=1e3 * SQUARE[:, :2])


def test_a_touched_point_comes_back_as_it_was(tmp_path: Path) -> None:
    save_data(tmp_path / "touches.json", ForearmData("lab", touches=(TOUCH,)))
    (found,) = load_data(tmp_path / "touches.json").touches
    assert isinstance(found.target, Spot)
    assert (found.target.name, found.target.sigma_m, found.force_N) == ("corner", 0.0004, 1.5)
    np.testing.assert_array_equal(found.target.point_world_m, SPOT.point_world_m)
    np.testing.assert_array_equal(found.point_distal_m, TOUCH.point_distal_m)


def test_a_finger_that_no_hand_has_is_not_stored(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="unknown finger XX"):
        save_data(tmp_path / "touches.json", ForearmData("lab", touches=(replace(TOUCH, finger="XX"),)))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "view", [replace(VIEW, board_px=VIEW.board_px[:3]), replace(VIEW, board_m=SQUARE[:3], board_px=VIEW.board_px[:3])]
)
def test_a_picture_needs_four_corners_and_a_pixel_for_each(tmp_path: Path, view: View) -> None:
    lens = CameraCalibration(focal_px=(800.0, 800.0), centre_px=(320.0, 240.0), distortion=(), size_px=(640, 480))
    data = ForearmData("lab", views=(VIEW, view), camera=lens, markers=MarkerSettings())
    save_data(tmp_path / "views.json", data)
    with pytest.raises(ConfigurationError, match="view 2 needs as many pixels as corners, and at least four"):
        load_data(tmp_path / "views.json")


def test_pictures_without_their_lens_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="pictures need the camera's lens and the markers"):
        problem_of(ForearmData(views=(VIEW,)), WizardSettings())
    save_data(tmp_path / "views.json", ForearmData("lab", views=(VIEW,)))
    with pytest.raises(ConfigurationError, match="views need camera and markers"):
        load_data(tmp_path / "views.json")


@pytest.mark.parametrize(("count", "steps"), [(1, 2), (5, 10), (20, 25)])
def test_solving_is_told_in_as_many_steps_as_there_are_observations_and_repeats(count: int, steps: int) -> None:
    assert solving_steps(ForearmData(touches=(TOUCH,) * count)) == steps
    assert solving_steps(ForearmData(views=(VIEW,) * count)) == steps
    assert solving_steps(ForearmData(pairs=(PosePair(Pose3(), Pose3()),) * count)) == steps


def test_instructions_say_where_in_millimetres() -> None:
    corners = {"corner": (0.1, -0.2, 0.3), "peg": (0.2, -0.2, 0.3), "hole": (0.1, -0.1, 0.3)}
    points = KnownGeometry(points_world_m=corners, point_sigma_m=0.0004)
    assert [patch.target.sigma_m for patch in patches(points) if patch.target.name == "point peg"] == [0.0004]
    touches = plan_touches(points, ("FF",), 2)
    told = [touch.instruction for touch in touches]
    assert told.count("FF presses point corner at (100, -200, 300) mm") == 2
    view = PlannedView(Pose3(Rot3(), np.array([0.1, -0.2, 0.3])), np.zeros(24))
    assert view.instruction == "show the board with the palm at (100, -200, 300) mm"
