"""The clock of the camera against the hand's, from one motion that both saw."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from drivers.core.contacts import Array
from tactile_lab.evaluation.truth.time_alignment import Track, clock_offset


def palm_at(stamps_s: Array) -> tuple[Array, Array]:
    places = np.column_stack([0.05 * np.sin(1.3 * stamps_s), 0.03 * np.cos(0.9 * stamps_s), 0.2 + 0 * stamps_s])
    return places, Rotation.from_euler("z", 0.4 * np.sin(0.7 * stamps_s)[:, None]).as_matrix()


def motion(offset_s: float, *, sigma_m: float = 0.0003, rate_hz: float = 30.0) -> tuple[Track, Array, Array]:
    """The palm at 12.5 Hz, and the object it holds as a camera sees it whose stamps are behind by the offset."""
    hand_s = np.arange(0.0, 8.0, 0.08)
    camera_s = np.arange(0.0, 8.0, 1 / rate_hz)
    places, turns = palm_at(camera_s + offset_s)
    seen = places + np.einsum("nij,j->ni", turns, np.array([0.02, -0.05, 0.0]))
    noise = sigma_m * np.random.default_rng(0).standard_normal((len(camera_s), 2))
    return Track(hand_s, *palm_at(hand_s)), camera_s, seen[:, :2] + noise


@pytest.mark.parametrize("offset_s", [0.0, 0.042, -0.113])
def test_the_offset_is_found_within_its_stated_deviation(offset_s: float) -> None:
    palm, stamps, places = motion(offset_s)
    found = clock_offset(palm, stamps, places, [(0.0, 3.5), (3.6, 8.0)])
    assert found.offset_ms is not None
    assert found.sigma_ms is not None
    assert found.sigma_ms < 3.0
    assert abs(found.offset_ms - 1e3 * offset_s) < max(4 * found.sigma_ms, 2.0)
    assert found.pictures > 100


def test_an_object_at_rest_tells_nothing() -> None:
    palm, stamps, _ = motion(0.0)
    found = clock_offset(palm, stamps, np.zeros((len(stamps), 2)), [(0.0, 8.0)])
    assert found.offset_ms is None
    assert "moved too little" in found.reason


def test_too_few_pictures_of_the_motion_tell_nothing() -> None:
    palm, stamps, places = motion(0.0)
    found = clock_offset(palm, stamps[:5], places[:5], [(0.0, 8.0)])
    assert found.offset_ms is None
    assert found.reason == "0 pictures of the moving object, 8 are needed"


def test_clocks_that_are_far_apart_are_told_not_guessed() -> None:
    palm, stamps, places = motion(0.9)
    found = clock_offset(palm, stamps, places, [(0.0, 7.0)])
    assert found.offset_ms is None
    assert "no offset within 300 ms" in found.reason


def test_the_stated_deviation_follows_from_noise_and_speed() -> None:
    """Without rotation an offset moves the object by its speed relative to the mean, against the noise per axis."""
    sigma_m, hand_s, camera_s = 0.0003, np.arange(0.0, 8.0, 0.02), np.arange(0.0, 8.0, 1 / 30)
    level = np.tile(np.eye(3), (len(hand_s), 1, 1))

    def along(stamps_s: Array) -> Array:
        return np.column_stack([0.05 * np.sin(1.3 * stamps_s), 0 * stamps_s, 0.2 + 0 * stamps_s])

    noise = sigma_m * np.random.default_rng(1).standard_normal((len(camera_s), 2))
    found = clock_offset(Track(hand_s, along(hand_s), level), camera_s, along(camera_s)[:, :2] + noise, [(0.0, 8.0)])
    used_s = camera_s[(camera_s >= 0.3) & (camera_s <= hand_s[-1] - 0.3)]
    speed_m_s = 0.05 * 1.3 * np.cos(1.3 * used_s)
    assert found.sigma_ms == pytest.approx(1e3 * sigma_m / np.linalg.norm(speed_m_s - speed_m_s.mean()), rel=0.15)
