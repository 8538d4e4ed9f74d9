"""What a lens is failed for: each figure in the unit of its limit."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.camera.intrinsics import LensLimits, LensResult, calibrate_lens
from calibration.camera.views import BoardView
from drivers.camera.boards import CharucoBoard
from drivers.camera.rendering.board_camera import board_poses, simulated_lens
from drivers.core.poses import transform_points

WIDTH_px = 640
LENS, BOARD = simulated_lens((WIDTH_px, 480)), CharucoBoard()
WIDE = {"reprojection_px": 50.0, "held_out_px": 50.0, "focal_percent": 50.0, "centre_px": 50.0}


def noisy_views(count: int) -> list[BoardView]:
    rng = np.random.default_rng(2)
    found = []
    for number, pose in enumerate(board_poses(BOARD, LENS, count, rng)):
        pixels = LENS.project(transform_points(pose, BOARD.corners_m))
        noisy = pixels + 0.3 * rng.standard_normal(pixels.shape)
        found.append(BoardView(f"{number}", BOARD.corners_m, noisy, (WIDTH_px, 480), max(BOARD.size_m)))
    return found


VIEWS = noisy_views(20)


def figures(result: LensResult) -> dict[str, float]:
    """What the limits are compared with, by the limit."""
    sigmas = result.sigmas
    return {
        "reprojection_px": result.reprojection_px,
        "held_out_px": result.held_out_px,
        "focal_percent": max(
            100 * sigmas[name] / f for name, f in zip(("fx_px", "fy_px"), result.lens.focal_px, strict=True)
        ),
        "centre_px": 1000 * max(sigmas["cx_px"], sigmas["cy_px"]) / WIDTH_px,
    }


@pytest.mark.parametrize("name", list(WIDE))
def test_a_lens_passes_just_above_its_figure_and_fails_just_below(name: str) -> None:
    figure = figures(calibrate_lens(VIEWS, LensLimits.model_validate(WIDE)))[name]
    assert calibrate_lens(VIEWS, LensLimits.model_validate(WIDE | {name: 1.001 * figure})).passed
    (problem,) = calibrate_lens(VIEWS, LensLimits.model_validate(WIDE | {name: 0.999 * figure})).problems
    assert f" {figure:.2f} {'%' if name == 'focal_percent' else 'px'}, at most" in problem


def test_a_third_radial_coefficient_is_free_only_when_asked_for() -> None:
    two, three = calibrate_lens(VIEWS), calibrate_lens(VIEWS, third_radial=True)
    assert two.lens.distortion[4] == 0.0
    assert three.lens.distortion[4] != 0.0
    assert set(three.sigmas) - set(two.sigmas) == {"k3"}


def test_as_many_views_as_the_limit_says_are_enough() -> None:
    wide = LensLimits.model_validate(WIDE | {"views": 20})
    assert calibrate_lens(VIEWS, wide).passed
    assert calibrate_lens(VIEWS[:19], wide).problems == ("19 views, at least 20",)
