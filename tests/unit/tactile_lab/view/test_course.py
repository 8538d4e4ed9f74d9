"""What the page plots over time, and the camera's picture."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from drivers.camera.frames import Detection, Frame
from drivers.camera.packet import encode_packet
from tactile_lab.view.course import SHOWN_s, ShownCourse
from tactile_lab.view.plots import shown_picture
from tactile_lab.view.scene import CAMERA_PACKETS, Scene

SECOND_ns = 10**9


def test_forces_are_thinned_and_the_newest_minute_is_kept() -> None:
    course = ShownCourse()
    for step in range(20 * 90):
        course.take_forces(step * SECOND_ns // 20, {"FF": 0.5, "TH": None})
    ages_s, first, thumb = course.force_table(("FF", "TH"))
    assert ages_s[-1] == 0.0
    assert -SHOWN_s <= ages_s[0] < -SHOWN_s + 1.0
    assert 250 < len(ages_s) < 350
    assert set(first) == {0.5}
    assert np.isnan(thumb).all()


def test_another_session_begins_anew() -> None:
    course = ShownCourse()
    course.take_forces(100 * SECOND_ns, {"FF": 0.5})
    course.take_forces(1 * SECOND_ns, {"FF": 0.1})
    assert [list(column) for column in course.force_table(("FF",))] == [[0.0], [0.1]]


def test_uncertainty_goes_back_with_an_undone_grasp() -> None:
    course = ShownCourse()
    for grasp in range(3):
        course.take_pose(grasp, np.diag([4e-6, 0.0, 1e-4]) / (grasp + 1))
        course.take_surface(np.array([0.001, 0.002, 0.003]))
    course.take_pose(1, None)
    numbers, position_mm, rotation_deg, surface_mm = course.uncertainty_table()
    assert list(numbers) == [1, 2]
    assert position_mm[0] == pytest.approx(2.0)
    assert rotation_deg[0] == pytest.approx(np.degrees(0.01))
    assert surface_mm[0] == pytest.approx(2.0)
    assert np.isnan([position_mm[1], rotation_deg[1], surface_mm[1]]).all()


def test_an_object_held_free_has_six_components() -> None:
    course = ShownCourse()
    course.take_pose(0, np.diag([1e-6, 4e-6, 4e-6, 0.0, 0.0, 1e-4]))
    _, position_mm, rotation_deg, _ = course.uncertainty_table()
    assert (position_mm[0], rotation_deg[0]) == pytest.approx((3.0, np.degrees(0.01)))


def test_the_newest_picture_is_kept_and_packets_without_one_change_nothing() -> None:
    scene, image = Scene(), np.full((60, 80), 120, np.uint8)
    _, encoded = cv2.imencode(".png", image)
    frame = Frame(1, None, 1, 0, Detection("DICT_4X4_50", (80, 60), {}))
    scene.take(CAMERA_PACKETS, encode_packet(frame, encoded.tobytes()), 1)
    assert scene.changed == {"picture"}
    shown = shown_picture(scene.picture)
    assert shown is not None
    assert shown.shape == (60, 80, 3)
    scene.changed.clear()
    scene.take(CAMERA_PACKETS, encode_packet(frame), 2)
    assert not scene.changed
    assert shown_picture(b"no picture") is None
    assert shown_picture(b"") is None
