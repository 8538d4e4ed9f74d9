"""The lens from views of a board: exact and noisy corners, held-out views, coverage, and refusals."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from calibration.camera.intrinsics import LensLimits, calibrate_lens
from calibration.camera.views import BoardView, adds_something, coverage, view_of
from calibration.store.store import read_record, write_record
from drivers.camera.boards import CharucoBoard
from drivers.camera.calibration import load_camera
from drivers.camera.rendering.board_camera import BoardView as Look
from drivers.camera.rendering.board_camera import board_poses, draw_board, simulated_lens
from drivers.camera.source_settings import CameraSourceSettings
from drivers.core.clock import VirtualClock
from drivers.core.errors import ConfigurationError
from drivers.core.poses import transform_points
from tactile_lab.workflow.calibrating_camera import gather_views, lens_record

LENS, BOARD = simulated_lens((640, 480)), CharucoBoard()


def views(count: int, noise_px: float = 0.1, seed: int = 0) -> list[BoardView]:
    rng = np.random.default_rng(seed)
    found = []
    for number, pose in enumerate(board_poses(BOARD, LENS, count, rng)):
        pixels = LENS.project(transform_points(pose, BOARD.corners_m))
        noisy = pixels + noise_px * rng.standard_normal(pixels.shape)
        found.append(BoardView(f"picture {number}", BOARD.corners_m, noisy, (640, 480), max(BOARD.size_m)))
    return found


def test_the_lens_comes_back_within_its_stated_deviations() -> None:
    result = calibrate_lens(views(30))
    assert result.passed, result.problems
    errors = np.subtract([*result.lens.focal_px, *result.lens.centre_px], [*LENS.focal_px, *LENS.centre_px])
    stated = np.array([result.sigmas[name] for name in ("fx_px", "fy_px", "cx_px", "cy_px")])
    assert np.all(np.abs(errors) < 4 * stated)
    assert np.all(stated < 1.5)
    assert result.reprojection_px == pytest.approx(0.14, abs=0.02)
    assert result.held_out_px == pytest.approx(0.14, abs=0.03)
    assert len(result.per_view_px) == 30
    assert result.left_out == {}


def test_a_view_that_disagrees_is_left_out_and_named() -> None:
    found = views(20)
    bent = found[7].pixels + 3.0 * np.random.default_rng(1).standard_normal(found[7].pixels.shape)
    found[7] = BoardView("picture 7", found[7].points_m, bent, (640, 480), found[7].board_m)
    result = calibrate_lens(found)
    assert list(result.left_out) == ["picture 7"]
    assert result.passed, result.problems


def test_views_that_no_lens_fits_give_no_figures() -> None:
    rng = np.random.default_rng(1)
    scattered = [
        BoardView(f"{n}", BOARD.corners_m, rng.uniform(0, 480, (len(BOARD.corners_m), 2)), (640, 480), 0.2)
        for n in range(8)
    ]
    with pytest.raises(ConfigurationError, match=r"no lens fits the views \(reprojection error .* px\)"):
        calibrate_lens(scattered)


def test_a_lens_without_deviations_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    def undetermined(*arguments: object, **options: object) -> tuple[object, ...]:
        return 1.23, np.eye(3), np.zeros(5), None, None, np.full(9, np.nan), None, np.zeros(8)

    monkeypatch.setattr("calibration.camera.intrinsics.cv2.calibrateCameraExtended", undetermined)
    with pytest.raises(ConfigurationError, match=r"no lens fits the views \(reprojection error 1\.2 px\)"):
        calibrate_lens(views(8))


def test_few_views_all_alike_fail_with_what_is_missing() -> None:
    rng, pose = np.random.default_rng(0), board_poses(BOARD, LENS, 1, np.random.default_rng(3))[0]
    exact = LENS.project(transform_points(pose, BOARD.corners_m))
    alike = [
        BoardView(f"{n}", BOARD.corners_m, exact + 0.1 * rng.standard_normal(exact.shape), (640, 480), 0.2)
        for n in range(6)
    ]
    result = calibrate_lens(alike)
    assert not result.passed
    assert result.problems[0] == "6 views, at least 12"
    assert any(problem.startswith("standard deviation of the focal length") for problem in result.problems)
    assert "not shown: the board nearer and farther away" in result.problems
    assert sum(problem.startswith("not shown: the board in the") for problem in result.problems) >= 3
    assert not adds_something(alike[1], alike[:1])


def test_a_limit_that_is_not_kept_is_named_with_its_figure() -> None:
    result = calibrate_lens(views(20, noise_px=0.6))
    assert any(problem.startswith("reprojection error 0.") for problem in result.problems)
    wide = LensLimits(reprojection_px=2, held_out_px=2, focal_percent=2, centre_px=20)
    assert calibrate_lens(views(20, noise_px=0.6), wide).passed


def test_coverage_tells_regions_tilts_and_distances() -> None:
    assert len(coverage([]).missing) == 14
    assert coverage(views(40)).missing == ()


def test_too_few_views_or_two_sizes_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="4 usable views of the board, but at least 5 are needed"):
        calibrate_lens(views(4))
    other = views(6)
    other[2] = BoardView("x", other[2].points_m, other[2].pixels, (1280, 720), 0.2)
    with pytest.raises(ConfigurationError, match="different sizes: 1280 x 720, 640 x 480"):
        calibrate_lens(other)


def test_blurred_pictures_and_pictures_without_the_board_are_refused_by_name() -> None:
    rng = np.random.default_rng(0)
    pose = board_poses(BOARD, LENS, 1, rng)[0]
    assert isinstance(view_of("a", draw_board(BOARD, pose, LENS, rng), BOARD), BoardView)
    blurred = view_of("a", draw_board(BOARD, pose, LENS, rng, Look(blur_px=3.2)), BOARD)
    assert isinstance(blurred, str)
    assert blurred.startswith(("blurred: edges", "no marker of"))
    empty = view_of("a", np.full((480, 640), 90, np.uint8), BOARD)
    assert empty == "no marker of DICT_4X4_50 is visible"


def write_views(folder: Path, count: int) -> None:
    rng = np.random.default_rng(5)
    for number, pose in enumerate(board_poses(BOARD, LENS, count, rng)):
        cv2.imwrite(str(folder / f"{number:02}.png"), draw_board(BOARD, pose, LENS, rng))


def test_a_folder_of_pictures_gives_a_stored_lens_that_loads(tmp_path: Path) -> None:
    write_views(tmp_path, 8)
    (tmp_path / "08.png").write_bytes((tmp_path / "07.png").read_bytes())
    told: list[int] = []
    settings = CameraSourceSettings(source=str(tmp_path))
    found = gather_views(settings, BOARD, VirtualClock(), told=lambda so_far: told.append(len(so_far.views)))
    assert found.alike == 1
    assert told == list(range(1, 9))
    result = calibrate_lens(found.views)
    assert result.lens.focal_px[0] == pytest.approx(LENS.focal_px[0], rel=0.01)
    write_record(tmp_path / "lens.yaml", lens_record(result, "laboratory", BOARD, LensLimits(), "C920-1"))
    record = read_record(tmp_path / "lens.yaml")
    assert record.verdict == "FAIL"
    assert record.details["problems"][0] == "8 views, at least 12"
    assert record.devices == {"camera": "C920-1"}
    assert load_camera(tmp_path / "lens.yaml").size_px == (640, 480)


def test_a_wrong_dictionary_is_named_with_the_right_one(lab_data: Path, tmp_path: Path) -> None:
    for name in ("choriginal.jpg", "img_00.jpg"):
        (tmp_path / name).write_bytes((lab_data / "aruco_photos" / name).read_bytes())
    wrong = CharucoBoard(dictionary="DICT_5X5_250", columns=5, rows=7, square_m=0.04, marker_m=0.02)
    with pytest.raises(
        ConfigurationError, match=r"markers of DICT_6X6_1000, but the board is described with DICT_5X5_250"
    ):
        gather_views(CameraSourceSettings(source=str(tmp_path)), wrong, VirtualClock())


def test_photographs_of_a_board_are_too_few_and_say_so(lab_data: Path, tmp_path: Path) -> None:
    for name in ("choriginal.jpg", "img_00.jpg", "img_01.jpg"):
        (tmp_path / name).write_bytes((lab_data / "aruco_photos" / name).read_bytes())
    board = CharucoBoard(dictionary="DICT_6X6_250", columns=5, rows=7, square_m=0.04, marker_m=0.02)
    found = gather_views(CameraSourceSettings(source=str(tmp_path)), board, VirtualClock())
    assert 1 <= len(found.views) <= 3
    assert found.refused == {}
    with pytest.raises(ConfigurationError, match="usable views of the board, but at least 5 are needed"):
        calibrate_lens(found.views)
