"""The part of a camera's picture that the report shows, and what is drawn into it."""

from __future__ import annotations

import re

import cv2
import numpy as np
from gtsam import Pose3, Rot3

from drivers.camera.calibration import CameraCalibration
from drivers.camera.markers import MarkerSettings
from drivers.core.contacts import Array
from tactile_lab.report.camera_picture import CameraView, draw_on_picture

ABOVE = Pose3(Rot3(np.diag([1.0, -1.0, -1.0])), np.array([0.0, 0.0, 0.5])).inverse()
"""``camera_T_world`` of a camera half a metre above the table that looks down, which is easier to imagine."""
PICTURE = cv2.imencode(".jpg", np.full((480, 640), 90, np.uint8))[1].tobytes()
LENS = CameraCalibration(focal_px=(800.0, 800.0), centre_px=(320.0, 240.0), distortion=(0.0,) * 5)


def view() -> CameraView:
    return CameraView(0, PICTURE, LENS, MarkerSettings(), ABOVE)


def square(side_m: float, x_m: float = 0.0) -> Array:
    return np.array([[x, y, 0.0] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]) * side_m / 2 + [x_m, 0.0, 0.0]


def size(text: str) -> tuple[int, int]:
    found = re.search(r'viewBox="0 0 (\d+) (\d+)"', text)
    assert found is not None
    return int(found[1]), int(found[2])


def test_the_picture_is_cut_to_what_is_drawn_and_its_surroundings() -> None:
    text = draw_on_picture(view(), [("estimate", square(0.05))], square(0.05), "words")
    width, height = size(text)
    assert abs(width - 160) <= 2  # 5 cm are 80 pixels
    assert abs(height - 160) <= 2
    assert text.count("estimate-seen") == 1
    assert text.count("contact-seen") == 4


def test_nothing_to_draw_or_nothing_in_sight_shows_the_whole_picture() -> None:
    for outlines in ([], [("estimate", square(0.05, x_m=3.0))]):
        assert size(draw_on_picture(view(), outlines, np.zeros((0, 3)), "words")) == (640, 480)


def test_what_is_behind_the_camera_is_not_drawn() -> None:
    behind = square(0.05) + np.array([0.0, 0.0, 0.6])
    assert "estimate-seen" not in draw_on_picture(view(), [("estimate", behind)], np.zeros((0, 3)), "words")
