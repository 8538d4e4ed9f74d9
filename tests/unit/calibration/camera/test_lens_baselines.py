"""Whole results of small fixed calibrations of a lens."""

from __future__ import annotations

import numpy as np

from calibration.camera.intrinsics import LensLimits, calibrate_lens
from calibration.camera.views import BoardView, adds_something, coverage, rough_lens, view_of
from drivers.camera.boards import CharucoBoard
from drivers.camera.rendering.board_camera import board_poses, simulated_lens
from drivers.core.poses import transform_points
from tests.support.baseline import assert_baseline
from tests.support.plain_values import plain

LENS, BOARD, SIZE_px = simulated_lens((640, 480)), CharucoBoard(), (640, 480)


def views(count: int) -> list[BoardView]:
    """Boards with 0.1 px of noise, the fifth with a hundred times as much."""
    rng = np.random.default_rng(6)
    found = []
    for number, pose in enumerate(board_poses(BOARD, LENS, count, rng)):
        pixels = LENS.project(transform_points(pose, BOARD.corners_m))
        noise_px = (10.0 if number == 4 else 0.1) * rng.standard_normal(pixels.shape)
        found.append(BoardView(f"picture {number}", BOARD.corners_m, pixels + noise_px, SIZE_px, max(BOARD.size_m)))
    return found


def test_a_lens_from_a_few_views() -> None:
    taken = views(9)
    strict = LensLimits(reprojection_px=0.01, held_out_px=0.01, focal_percent=0.01, centre_px=0.01)
    found = {
        "two radial": plain(calibrate_lens(taken)),
        "three radial, strict": plain(calibrate_lens(taken[:6], strict, third_radial=True)),
        "views": [[view.tilt, view.distance, view.features] for view in taken],
        "coverage": plain(coverage(taken[:3])),
        "nothing": plain(coverage([])),
        "rough": plain(rough_lens(SIZE_px)),
        "new": [adds_something(view, taken[:number]) for number, view in enumerate(taken)],
        "empty": view_of("empty", np.full((480, 640), 200, np.uint8), BOARD),
    }
    assert_baseline("calibration/lens", found, rtol=1e-4, atol=1e-8)
