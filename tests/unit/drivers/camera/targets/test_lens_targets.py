"""Chessboards and AprilGrids: found where they are, printed as they are read, described as for Kalibr."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from gtsam import Pose3, Rot3

from calibration.camera.views import BoardView, view_of
from drivers.camera.boards import GridBoard, load_board
from drivers.camera.rendering.board_camera import BoardView as Look
from drivers.camera.rendering.board_camera import board_poses, draw_board, simulated_lens
from drivers.camera.targets.april_grid import AprilGrid
from drivers.camera.targets.chessboard import Chessboard
from drivers.core.errors import ConfigurationError
from drivers.core.poses import transform_points

LENS = simulated_lens((640, 480))
TARGETS = (Chessboard(), Chessboard(columns=8, rows=8), AprilGrid(), AprilGrid(columns=4, rows=3, border=1))
Target = Chessboard | AprilGrid


def named(target: Target) -> str:
    return f"{target.kind}-{target.columns}x{target.rows}"


@pytest.mark.parametrize("target", TARGETS, ids=named)
def test_corners_of_a_drawn_target_are_found_where_they_are(target: Target) -> None:
    rng = np.random.default_rng(2)
    pose = board_poses(target, LENS, 1, rng)[0]
    view = view_of("a", draw_board(target, pose, LENS, rng), target)
    assert isinstance(view, BoardView), view
    assert len(view.points_m) >= (1.0 if isinstance(target, Chessboard) else 0.6) * target.point_count
    turned = (pose, pose * Pose3(Rot3.Yaw(np.pi), np.zeros(3)))  # a chessboard may be read half a turn on
    misfits = [LENS.project(transform_points(each, view.points_m)) - view.pixels for each in turned]
    rms = [float(np.sqrt(np.mean(np.square(misfit)))) for misfit in misfits]
    assert min(rms) < 0.35
    assert isinstance(target, Chessboard) or rms[0] < 0.35


@pytest.mark.parametrize("target", TARGETS, ids=named)
def test_a_mirror_image_is_never_read(target: Target) -> None:
    """Clockwise on the print is clockwise in the picture."""
    pose = board_poses(target, LENS, 1, np.random.default_rng(4))[0]
    points, pixels = target.match_corners(draw_board(target, pose, LENS, np.random.default_rng(0)))
    mapping, _ = cv2.findHomography(points[:, :2], pixels)
    assert np.linalg.det(mapping) * np.linalg.det(mapping[:2, :2]) > 0
    assert np.linalg.det(mapping[:2, :2] / mapping[2, 2]) < 0  # y is up on the print and down in the picture


def test_columns_and_rows_that_were_confused_are_told_by_every_picture() -> None:
    rng = np.random.default_rng(0)
    printed, described = AprilGrid(columns=6, rows=5), AprilGrid(columns=5, rows=6)
    for pose in board_poses(printed, LENS, 5, rng):
        told = view_of("a", draw_board(printed, pose, LENS, rng), described)
        assert told == "its corners lie elsewhere than the description says: count its columns and rows"


@pytest.mark.parametrize("target", TARGETS[::2], ids=named)
def test_blur_and_absence_are_told_in_words(target: Target) -> None:
    rng = np.random.default_rng(0)
    pose = board_poses(target, LENS, 1, rng)[0]
    blurred = view_of("a", draw_board(target, pose, LENS, rng, Look(blur_px=3.2)), target)
    assert isinstance(blurred, str)
    assert blurred.startswith(("blurred: edges 3.", "no "))
    empty = view_of("a", np.full((480, 640), 90, np.uint8), target)
    assert empty == f"no {target.pattern} is visible"


def test_tags_count_from_the_bottom_left_and_stand_as_kalibr_prints_them() -> None:
    """The bits of code 0, 0xd5d628584, from the top left on; a black frame of two modules around them."""
    grid = AprilGrid()
    modules = grid.marker_image(0, 10)[2:8, 2:8] > 0
    assert int("".join("01"[bit] for bit in modules.ravel().astype(int)), 2) == 0xD5D628584
    first, last = grid.marker_corners_m(0).mean(axis=0), grid.marker_corners_m(29).mean(axis=0)
    assert np.all(first[:2] < 0)
    np.testing.assert_allclose(first, -last, atol=1e-12)


def test_tags_that_stand_the_other_way_are_read_too() -> None:
    upright = AprilGrid()
    pose = board_poses(upright, LENS, 1, np.random.default_rng(4))[0]
    turned = np.ascontiguousarray(draw_board(upright, pose, LENS, np.random.default_rng(0))[::-1, ::-1])
    points, pixels = upright.match_corners(turned)  # the whole print half a turn on: its own bottom left is told
    mapping, _ = cv2.findHomography(points[:, :2], pixels)
    assert mapping[0, 0] / mapping[2, 2] < 0
    assert mapping[1, 1] / mapping[2, 2] > 0


KALIBR_GRID = "target_type: 'aprilgrid'\ntagCols: 6\ntagRows: 5\ntagSize: 0.088\ntagSpacing: 0.3\n"
KALIBR_CHESS = (
    "target_type: checkerboard\ntargetCols: 6\ntargetRows: 7\nrowSpacingMeters: 0.06\ncolSpacingMeters: 0.06\n"
)


def test_kalibrs_descriptions_are_read(tmp_path: Path) -> None:
    file = tmp_path / "target.yaml"
    file.write_text(KALIBR_GRID)
    grid = load_board(file)
    assert isinstance(grid, AprilGrid)
    assert (grid.columns, grid.rows, grid.side_m, grid.border) == (6, 5, 0.088, 2)
    assert grid.gap_m == pytest.approx(0.0264)
    file.write_text(KALIBR_CHESS)
    assert load_board(file) == Chessboard(columns=7, rows=8, square_m=0.06)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (KALIBR_GRID.replace("tagRows", "tagrows"), "tagRows"),
        (KALIBR_GRID.replace("0.3", "-1"), "tagSpacing"),
        (KALIBR_GRID.replace("tagCols: 6", "tagCols: 50").replace("tagRows: 5", "tagRows: 50"), "not 2499"),
        (KALIBR_CHESS.replace("rowSpacingMeters: 0.06", "rowSpacingMeters: 0.05"), "are not square"),
        ("target_type: circlegrid\n", "'circlegrid' is not known"),
        ("kind: chessboard\ncolumns: 3\n", "columns"),
        ("kind: aprilgrid\ngap_m: 0.03\n", "gap_m is smaller than side_m"),
    ],
)
def test_a_target_that_cannot_be_is_refused(tmp_path: Path, text: str, complaint: str) -> None:
    file = tmp_path / "target.yaml"
    file.write_text(text)
    with pytest.raises(ConfigurationError, match=complaint):
        load_board(file)


def test_markers_whose_edges_cannot_be_measured_are_not_called_blurred() -> None:
    """Black right beside the markers: no white border, no edge."""
    grid = GridBoard(columns=2, rows=2)
    pose = board_poses(grid, LENS, 1, np.random.default_rng(1))[0]
    image = draw_board(grid, pose, LENS, np.random.default_rng(1))
    grid_without_edges = GridBoardWithoutEdges(columns=2, rows=2)
    told = view_of("a", image, grid_without_edges)
    assert isinstance(told, str)
    assert told.startswith("no edge of its markers can be measured")


class GridBoardWithoutEdges(GridBoard):
    def blurs_px(self, image: object) -> list[float]:
        return [float("inf")] * 4
