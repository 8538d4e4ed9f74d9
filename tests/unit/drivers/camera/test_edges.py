"""Edges of printed squares: drawn finely, blurred exactly, and found where they are, however wide the blur."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.camera.edges import refine_square
from drivers.camera.frames import Image
from drivers.camera.markers import MarkerSettings
from drivers.core.contacts import Array

SIZE, FINER, MODULES = 128, 8, 6
TURNS = st.floats(-3.0, 3.0)


def corners_of(module_px: float, turn_rad: float, keystone: float = 0.0) -> Array:
    """Corners (4, 2) of a turned square in the middle of the picture, one side shortened by the keystone."""
    half = module_px * MODULES / 2
    square = half * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    square[:2, 0] *= 1 - keystone
    cosine, sine = np.cos(turn_rad), np.sin(turn_rad)
    return np.asarray(square @ np.array([[cosine, sine], [-sine, cosine]]) + SIZE / 2 + [0.3, -0.2])


def picture(corners: Array, blur_px: float, beyond: int = 150, *, white: float = 0.5, noise: float = 0.0) -> Image:
    """Marker 7 with ``white`` modules around it on a table of grey level ``beyond``."""
    tile_px = 20
    border = round(white * tile_px)
    bits = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), 7, MODULES * tile_px)
    tile = np.where(np.pad(bits, border, constant_values=255) > 127, 235, 20)
    end = border + MODULES * tile_px
    inner = np.array([[border, border], [end, border], [end, end], [border, end]], np.float32) - 0.5
    warp = cv2.getPerspectiveTransform(inner, ((corners + 0.5) * FINER - 0.5).astype(np.float32))
    size = (SIZE * FINER, SIZE * FINER)
    fine = cv2.warpPerspective(tile.astype(np.float32), warp, size, borderValue=float(beyond))
    sharp = cv2.GaussianBlur(fine, (0, 0), blur_px * FINER)
    coarse = cv2.resize(sharp, (SIZE, SIZE), interpolation=cv2.INTER_AREA)
    noisy = coarse + noise * np.random.default_rng(1).standard_normal(coarse.shape)
    return np.asarray(np.clip(noisy, 0, 255), np.uint8)


def growth_px(found: Array, truth: Array) -> float:
    """How far outward the sides lie of their true places on the mean."""
    areas = [cv2.contourArea(corners.astype(np.float32)) for corners in (found, truth)]
    return float((areas[0] - areas[1]) / cv2.arcLength(truth.astype(np.float32), closed=True))


@settings(max_examples=25, derandomize=True, deadline=None)
@given(
    module_px=st.floats(5.0, 12.0),
    blur_px=st.floats(0.4, MarkerSettings().largest_blur_px),
    turn_rad=TURNS,
    beyond=st.integers(20, 200),
    keystone=st.floats(0.0, 0.15),
)
def test_squares_have_their_size_up_to_the_blur_at_which_pictures_are_refused(
    module_px: float, blur_px: float, turn_rad: float, beyond: int, keystone: float
) -> None:
    truth = corners_of(module_px, turn_rad, keystone)
    guess = truth.mean(axis=0) + 0.97 * (truth - truth.mean(axis=0))
    seen = refine_square(picture(truth, blur_px, beyond), guess, MODULES)
    assert abs(growth_px(seen.corners_px, truth)) < 0.03
    assert np.abs(seen.corners_px - truth).max() < 0.15
    assert seen.blur_px == pytest.approx(np.sqrt(blur_px**2 + 1 / 12 + 1 / 6), abs=0.12)  # pixels, and between


@pytest.mark.parametrize("white", [1.0, 1.5])
@pytest.mark.parametrize("blur_px", [0.7, 1.5])
def test_wider_white_does_not_move_the_edge(white: float, blur_px: float) -> None:
    truth = corners_of(8.0, 0.4)
    seen = refine_square(picture(truth, blur_px, 30, white=white), truth + 0.5, MODULES)
    assert abs(growth_px(seen.corners_px, truth)) < 0.05


def test_a_guess_that_is_too_small_by_a_blurred_corner_is_mended() -> None:
    truth = corners_of(5.0, 0.7)
    guess = truth.mean(axis=0) + 0.85 * (truth - truth.mean(axis=0))
    seen = refine_square(picture(truth, 1.2, noise=3.0), guess, MODULES)
    np.testing.assert_allclose(seen.corners_px, truth, atol=0.25)


@pytest.mark.parametrize("blur_px", [2.0, 2.6])
def test_a_wide_blur_is_told_as_wide(blur_px: float) -> None:
    truth = corners_of(9.0, 0.3)
    seen = refine_square(picture(truth, blur_px, noise=3.0), truth, MODULES)
    assert seen.blur_px > MarkerSettings().largest_blur_px
    assert seen.blur_px == pytest.approx(blur_px, rel=0.15)


@pytest.mark.parametrize("noise", [0.0, 5.0])
def test_where_there_is_no_square_the_guess_is_given_back_as_not_sharp(noise: float) -> None:
    guess = corners_of(8.0, 0.4)
    empty = np.clip(120 + noise * np.random.default_rng(2).standard_normal((SIZE, SIZE)), 0, 255).astype(np.uint8)
    seen = refine_square(empty, guess, MODULES)
    assert seen.blur_px == np.inf
    np.testing.assert_array_equal(seen.corners_px, guess)
