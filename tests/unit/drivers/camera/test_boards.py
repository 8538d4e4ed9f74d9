"""Boards: detection in drawn pictures and photographs, the convention of their frame, and refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from gtsam import Pose3, Rot3

from drivers.camera.boards import CharucoBoard, GridBoard, SingleMarker, load_board
from drivers.camera.calibration import CameraCalibration, load_camera
from drivers.camera.frames import decode_image
from drivers.camera.pose.board_pose import board_pose, pose_covariance
from drivers.camera.rendering.board_camera import board_poses, draw_board, simulated_lens
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.core.poses import rotation_angle_rad, transform_points

LENS = simulated_lens((640, 480))
BOARDS = (CharucoBoard(), GridBoard(), SingleMarker(number=3))
AnyBoard = SingleMarker | GridBoard | CharucoBoard


@pytest.mark.parametrize("board", BOARDS, ids=lambda board: board.kind)
def test_a_drawn_board_is_found_whole_where_it_is(board: AnyBoard) -> None:
    rng = np.random.default_rng(2)
    for truth in board_poses(GridBoard() if board.kind == "single" else board, LENS, 3, rng):
        points, pixels = board.match_corners(draw_board(board, truth, LENS, rng))
        assert len(points) == board.point_count
        found = board_pose(points, pixels, LENS)
        assert found is not None
        assert board.kind == "single" or not found.ambiguous
        error = truth.between(found.camera_T_board)
        assert np.linalg.norm(error.translation()) < 0.004 * np.linalg.norm(truth.translation())
        assert rotation_angle_rad(error) < np.radians(3.0 if board.kind == "single" else 0.6)


def test_a_board_tilted_exactly_about_an_axis_of_the_picture_has_its_pose() -> None:
    truth = Pose3(Rot3.Ry(-0.3), np.array([0.0, 0.0, 0.6]))
    corners = np.array([[x, y, 0.0] for y in np.linspace(-0.1, 0.1, 5) for x in np.linspace(-0.1, 0.1, 5)])
    lens = CameraCalibration(focal_px=(704.0, 704.0), centre_px=(320.0, 240.0), size_px=(640, 480))
    found = board_pose(corners, lens.project(transform_points(truth, corners)), lens)
    assert found is not None
    assert found.camera_T_board.equals(truth, 1e-5)


@pytest.mark.parametrize("board", BOARDS, ids=lambda board: board.kind)
def test_every_board_has_its_origin_in_the_middle_x_right_y_up(board: AnyBoard) -> None:
    """Upright before the camera: z of the board towards the camera, its y against the camera's y."""
    upright = Pose3(Rot3(np.diag([1.0, -1.0, -1.0])), np.array([0.0, 0.0, 2.5 * max(board.size_m)]))
    points, pixels = board.match_corners(draw_board(board, upright, LENS, np.random.default_rng(0)))
    np.testing.assert_allclose(points.mean(axis=0), 0.0, atol=1e-7)
    assert np.corrcoef(points[:, 0], pixels[:, 0])[0, 1] > 0.99
    assert np.corrcoef(points[:, 1], pixels[:, 1])[0, 1] < -0.99


def test_the_photographed_grid_shows_its_35_markers_and_points_to_the_camera(lab_data: Path) -> None:
    folder = lab_data / "aruco_photos"
    board = GridBoard(dictionary=str(folder / "tutorial_dict.yml"), columns=5, rows=7, side_m=0.04, gap_m=0.01)
    points, pixels = board.match_corners(decode_image((folder / "gboriginal.png").read_bytes()))
    assert len(points) == 4 * 35
    found = board_pose(points, pixels, load_camera(folder / "tutorial_camera_params.yml"))
    assert found is not None
    assert not found.ambiguous
    towards = found.camera_T_board.rotation().matrix()[:, 2] @ np.array(found.camera_T_board.translation())
    assert towards < 0, "z out of the print, to the camera"
    np.testing.assert_allclose(found.camera_T_board.matrix()[:3, 0], [0.95, 0.23, -0.19], atol=0.02)
    np.testing.assert_allclose(found.camera_T_board.matrix()[:3, 1], [0.30, -0.72, 0.62], atol=0.02)
    assert found.camera_T_board.z() == pytest.approx(0.59, abs=0.02)


@pytest.mark.parametrize(
    ("name", "place"), [("choriginal.jpg", (-0.014, -0.047, 0.340)), ("img_00.jpg", (0.012, -0.057, 0.334))]
)
def test_photographed_charuco_boards_give_24_corners_and_one_pose(
    lab_data: Path, name: str, place: tuple[float, float, float]
) -> None:
    folder = lab_data / "aruco_photos"
    board = CharucoBoard(dictionary="DICT_6X6_250", columns=5, rows=7, square_m=0.04, marker_m=0.02)
    points, pixels = board.match_corners(decode_image((folder / name).read_bytes()))
    assert len(points) == 24
    found = board_pose(points, pixels, load_camera(folder / "tutorial_camera_charuco.yml"))
    assert found is not None
    assert found.reprojection_px < 0.3
    assert not found.ambiguous
    np.testing.assert_allclose(found.camera_T_board.translation(), place, atol=0.001)


def test_a_small_square_far_away_is_ambiguous_and_gives_both_poses() -> None:
    square, rng, flagged = 0.01, np.random.default_rng(0), 0
    corners = SingleMarker(side_m=square).side_m / 2 * np.array([[-1.0, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])
    for _ in range(20):
        tilted = Pose3(Rot3.RzRyRx(np.pi + 0.15, 0.0, 0.0), np.array([0.05, 0.02, 0.6]))
        pixels = LENS.project(transform_points(tilted, corners)) + 0.1 * rng.standard_normal((4, 2))
        found = board_pose(corners, pixels, LENS)
        assert found is not None
        assert len(found.others) == 1
        flagged += found.ambiguous
    assert flagged == 20


def test_the_stated_covariance_is_that_of_the_corners_noise() -> None:
    board, rng = CharucoBoard(), np.random.default_rng(4)
    truth = board_poses(board, LENS, 1, rng)[0]
    exact = LENS.project(transform_points(truth, board.corners_m))
    changes = [_change(truth, board.corners_m, exact + 0.2 * rng.standard_normal(exact.shape)) for _ in range(200)]
    stated = pose_covariance(truth, board.corners_m, LENS, 0.2)
    ratio = np.sqrt(np.diag(np.cov(np.array(changes).T)) / np.diag(stated))
    assert np.all((ratio > 0.85) & (ratio < 1.15)), ratio


def _change(truth: Pose3, points: Array, pixels: Array) -> Array:
    found = board_pose(points, pixels, LENS)
    assert found is not None
    change = truth.between(found.camera_T_board)
    return np.concatenate([Rot3.Logmap(change.rotation()), change.translation()])


def test_too_few_corners_or_corners_in_a_line_give_no_pose() -> None:
    line = np.column_stack([np.linspace(0, 0.1, 6), np.zeros((6, 2))])
    pixels = LENS.project(line + np.array([0.0, 0.0, 0.5]))
    assert board_pose(line, pixels, LENS) is None
    assert board_pose(line[:3], pixels[:3], LENS) is None


def test_a_measured_bar_scales_the_corners() -> None:
    board = CharucoBoard(measured_bar_mm=99.7)
    assert board.scale == pytest.approx(0.997)
    np.testing.assert_allclose(board.corners_m, 0.997 * CharucoBoard().corners_m)
    np.testing.assert_allclose(
        GridBoard(measured_bar_mm=100.4).marker_corners_m(3), 1.004 * GridBoard().marker_corners_m(3)
    )


@pytest.mark.parametrize("bar_mm", [99.4, 100.6, 25.4])
def test_a_bar_half_a_per_cent_off_is_refused_with_the_reason(tmp_path: Path, bar_mm: float) -> None:
    file = tmp_path / "board.yaml"
    file.write_text(f"kind: charuco\nmeasured_bar_mm: {bar_mm}\n")
    with pytest.raises(ConfigurationError, match=r"at most 0\.5 % are allowed") as caught:
        load_board(file)
    assert "Print at 100 % (actual size)" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("kind: grid\ncolumns: 20\nrows: 20\n", "DICT_4X4_50 has markers 0 to 49, not 399"),
        ("kind: single\nnumber: 50\n", "not 50"),
        ("kind: charuco\nmarker_m: 0.05\n", "marker_m is smaller than square_m"),
        ("kind: checkerboard\n", "checkerboard"),
        ("kind: single\ndictionary: DICT_3X3\n", "not an OpenCV dictionary"),
        ("kind: single\ndictionary: nowhere.yml\n", "contains no dictionary"),
        ("just words\n", "not a description of a board"),
    ],
)
def test_a_board_that_can_not_be_is_refused(tmp_path: Path, text: str, complaint: str) -> None:
    file = tmp_path / "board.yaml"
    file.write_text(text)
    with pytest.raises(ConfigurationError, match=complaint):
        load_board(file)


def test_a_lens_without_picture_size_draws_nothing() -> None:
    with pytest.raises(ConfigurationError, match="picture size is missing"):
        draw_board(CharucoBoard(), Pose3(), LENS.model_copy(update={"size_px": None}), np.random.default_rng(0))
