"""Faces that are parallel, at right angles, upright or level, and those that are not."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Rot3
from hypothesis import given
from hypothesis import strategies as st

from drivers.core.contacts import Array
from tactile_lab.slam.shape.regularities import Kind, Regularity, regular_normals

WALLS = np.array([[1.0, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1]])
SIGMA_rad = np.deg2rad(1.5)


def leaning(normals: Array, seed: int, sigma_rad: float = SIGMA_rad) -> tuple[Array, Array]:
    """Unit normals turned at random, and the covariance of their components."""
    count, dimension = normals.shape
    moved = normals + np.random.default_rng(seed).normal(0.0, sigma_rad, normals.shape)
    moved /= np.linalg.norm(moved, axis=1, keepdims=True)
    blocks = sigma_rad**2 * (np.eye(dimension) - moved[:, :, None] * moved[:, None, :])
    covariance = np.zeros((count, dimension, count, dimension))
    covariance[np.arange(count), :, np.arange(count), :] = blocks
    return moved, covariance.reshape(count * dimension, -1)


@given(seed=st.integers(0, 10_000), yaw_rad=st.floats(-3.1, 3.1))
def test_what_is_taken_is_met_exactly(seed: int, yaw_rad: float) -> None:
    normals, covariance = leaning(WALLS @ Rot3.Yaw(yaw_rad).matrix().T, seed)
    found = regular_normals(normals, covariance, upright=True)
    for regularity in found.regularities:
        assert np.abs(regularity.state(found.normals).gap).max() < 1e-6
    assert np.linalg.norm(found.normals, axis=1) == pytest.approx(1.0)
    assert np.arccos(np.clip(np.sum(found.normals * normals, axis=1), -1.0, 1.0)).max() < 5 * SIGMA_rad


def test_a_box_on_a_table_keeps_nothing_but_its_heading() -> None:
    errors_rad = []
    for seed in range(20):
        normals, covariance = leaning(WALLS, seed, np.deg2rad(0.5))
        found = regular_normals(normals, covariance, upright=True)
        if found.saved == 9:  # of ten angles; now and then chance makes a pair look askew
            errors_rad.append(np.arctan2(found.normals[0, 1], found.normals[0, 0]))
            assert found.normals[4] == pytest.approx([0, 0, 1], abs=1e-6)
    assert len(errors_rad) >= 16
    assert np.std(errors_rad) == pytest.approx(np.deg2rad(0.5) / 2, rel=0.4)  # four walls are known as one


def test_what_is_known_of_one_wall_helps_those_tied_to_it() -> None:
    normals, covariance = leaning(WALLS, 1)
    sure = covariance.copy()
    sure[:3, :] = sure[:, :3] = 0.0
    sure[:3, :3] = 1e-8 * np.eye(3)
    found = regular_normals(np.vstack([WALLS[:1], normals[1:]]), sure, upright=True)
    assert found.normals[1:4] == pytest.approx(WALLS[1:4], abs=2e-3)


def test_a_face_that_is_clearly_askew_keeps_its_direction() -> None:
    angles = np.deg2rad([0.0, 98.0, 180.0])
    normals = np.column_stack([np.cos(angles), np.sin(angles)])
    _, covariance = leaning(normals, 0)
    found = regular_normals(normals, covariance, upright=False)
    assert found.regularities == (Regularity("parallel", 2, 0),)
    assert found.saved == 1
    assert found.normals == pytest.approx(normals, abs=1e-6)


def test_regularities_that_follow_from_others_save_nothing() -> None:
    angles = np.deg2rad([0.0, 90.0, 180.0, 270.0])
    normals, covariance = leaning(np.column_stack([np.cos(angles), np.sin(angles)]), 3, np.deg2rad(0.2))
    found = regular_normals(normals, covariance, upright=False)
    assert found.saved == 3


@pytest.mark.parametrize("kind", ["level", "upright", "parallel", "right angle"])
@given(seed=st.integers(0, 10_000))
def test_the_rows_are_the_derivatives_where_faces_are_nearly_regular(kind: Kind, seed: int) -> None:
    rng = np.random.default_rng(seed)
    one = {"level": [0.0, 0, 1], "upright": [0.6, 0.8, 0]}.get(kind, [0.0, 1, 0])
    other = [0.0, -1, 0] if kind == "parallel" else [1.0, 0, 0]
    normals = np.array([one, other])
    regularity = Regularity(kind, 0, 0 if kind in ("level", "upright") else 1)
    step = 1e-5 * np.cross(rng.normal(size=(2, 3)), normals)
    stated, moved = regularity.state(normals), normals + step
    if kind == "parallel":  # its axes go with the first face
        across = stated.rows.reshape(-1, 2, 3)[:, 1]
        change = across @ (moved[1] + moved[0])
    else:
        change = regularity.state(moved).gap - stated.gap
    assert stated.rows @ step.ravel() == pytest.approx(change, abs=1e-9)
