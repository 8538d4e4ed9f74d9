"""Relative poses of associated contacts (eq. 3.26) on the table and in space."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose2, Pose3, Rot3
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.errors import TrackingError
from drivers.core.poses import planar, rotate, spatial, transform_points
from tactile_lab.slam.graph.registration import UNKNOWN_VARIANCE_m2, align
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet

BOX_POINTS = (
    np.array([[5, 1, 0], [5, -2, 2], [-5, 0, 1], [2, 3, 0], [-2, 3, 1], [1, -3, 2], [0, 1, 3], [2, -1, 3]]) / 100
)
BOX_NORMALS = np.array(
    [[1, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, 1]], dtype=float
)


def contacts(points: np.ndarray, normals: np.ndarray) -> ContactSet:
    return ContactSet(points, normals, np.full(len(points), 1e-3), np.full(len(points), 0.087))


def slid_on_faces(rng: np.random.Generator) -> np.ndarray:
    """Other places on the same faces."""
    slide = rng.normal(size=BOX_POINTS.shape) * 0.003
    return BOX_POINTS + slide - np.sum(slide * BOX_NORMALS, axis=1, keepdims=True) * BOX_NORMALS


def moved(pose: Pose3, points: np.ndarray, normals: np.ndarray, dimension: int) -> ContactSet:
    return contacts(transform_points(pose, points)[:, :dimension], rotate(pose, normals)[:, :dimension])


@given(st.floats(-0.03, 0.03), st.floats(-0.03, 0.03), st.floats(-0.5, 0.5), st.integers(0, 1000))
@settings(max_examples=20, derandomize=True, deadline=None)
def test_a_motion_on_the_table_is_found_from_other_places_on_the_same_faces(
    x: float, y: float, yaw: float, seed: int
) -> None:
    truth = spatial(Pose2(x, y, yaw))
    sides = slice(0, 6)
    source = moved(truth.inverse(), slid_on_faces(np.random.default_rng(seed))[sides], BOX_NORMALS[sides], 2)
    found = align(source, contacts(BOX_POINTS[sides, :2], BOX_NORMALS[sides, :2]), on_table=True)
    assert found.observable
    assert planar(found.target_T_source).equals(planar(truth), 1e-6)
    assert found.rms_m == pytest.approx(0.0, abs=1e-6)


def test_a_motion_in_space_is_found() -> None:
    truth = Pose3(Rot3.Ypr(0.3, -0.2, 0.1), np.array([0.01, -0.02, 0.015]))
    source = moved(truth.inverse(), slid_on_faces(np.random.default_rng(0)), BOX_NORMALS, 3)
    found = align(source, contacts(BOX_POINTS, BOX_NORMALS), on_table=False)
    assert found.target_T_source.equals(truth, 1e-6)
    assert found.covariance.shape == (6, 6)


def test_the_table_keeps_contacts_in_space_from_tilting() -> None:
    truth = spatial(Pose2(0.01, -0.01, 0.2))
    source = moved(truth.inverse(), BOX_POINTS, BOX_NORMALS, 3)
    found = align(source, contacts(BOX_POINTS, BOX_NORMALS), on_table=True)
    assert found.target_T_source.equals(truth, 1e-6)
    assert found.covariance.shape == (3, 3)


@pytest.mark.parametrize("on_table", [True, False])
def test_the_covariance_is_the_spread_of_repeated_estimates(on_table: bool) -> None:
    rng = np.random.default_rng(3)
    target, errors = contacts(BOX_POINTS, BOX_NORMALS), []
    for _ in range(300):
        noisy = contacts(BOX_POINTS + rng.normal(size=(8, 3)) * 1e-3, BOX_NORMALS)
        truer = contacts(BOX_POINTS + rng.normal(size=(8, 3)) * 1e-3, BOX_NORMALS)
        motion = align(noisy, truer, on_table=on_table).target_T_source
        errors.append(Pose2.Logmap(planar(motion)) if on_table else Pose3.Logmap(motion))
    expected = align(target, target, on_table=on_table).covariance
    ratio = np.array(errors).std(axis=0) / np.sqrt(np.diag(expected))
    assert np.all((ratio > 0.7) & (ratio < 1.3))


def test_chi_square_counts_the_free_distances() -> None:
    rng = np.random.default_rng(5)
    values = []
    for _ in range(200):
        noisy = contacts(BOX_POINTS + rng.normal(size=(8, 3)) * 1e-3, BOX_NORMALS)
        values.append(align(noisy, contacts(BOX_POINTS + rng.normal(size=(8, 3)) * 1e-3, BOX_NORMALS), on_table=True))
    assert values[0].degrees_of_freedom == 5
    assert np.mean([value.chi_square for value in values]) == pytest.approx(5.0, rel=0.2)


def test_a_direction_without_contacts_is_left_alone_and_said_to_be_unknown() -> None:
    ends = [0, 1, 2]
    truth = spatial(Pose2(0.004, 0.02, 0.0))
    source = moved(truth.inverse(), BOX_POINTS[ends], BOX_NORMALS[ends], 2)
    found = align(source, contacts(BOX_POINTS[ends, :2], BOX_NORMALS[ends, :2]), on_table=True)
    assert not found.observable
    assert found.target_T_source.x() == pytest.approx(0.004, abs=1e-6)
    assert found.target_T_source.y() == pytest.approx(0.0, abs=1e-6)
    assert found.covariance[1, 1] == pytest.approx(UNKNOWN_VARIANCE_m2, rel=0.01)
    assert found.covariance[0, 0] < 1e-5


def test_pairs_that_do_not_match_are_refused() -> None:
    with pytest.raises(TrackingError, match="8 and 7 contacts"):
        align(contacts(BOX_POINTS, BOX_NORMALS), contacts(BOX_POINTS[1:], BOX_NORMALS[1:]), on_table=True)
    with pytest.raises(TrackingError, match="0 and 0"):
        align(contacts(BOX_POINTS[:0], BOX_NORMALS[:0]), contacts(BOX_POINTS[:0], BOX_NORMALS[:0]), on_table=True)
    with pytest.raises(TrackingError, match="NaN"):
        align(contacts(BOX_POINTS * np.nan, BOX_NORMALS), contacts(BOX_POINTS, BOX_NORMALS), on_table=True)
