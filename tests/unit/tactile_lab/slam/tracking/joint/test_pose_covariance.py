"""Covariances of poses, in the first grasp's object frame and in the common one, against their errors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from drivers.core.contacts import Array
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.evidence.pose_evidence import PoseEvidence
from tactile_lab.slam.tracking.faces.facet_smoothing import smoothed_with_faces
from tactile_lab.slam.tracking.joint.pose_covariance import PoseCovariances, with_covariances
from tests.support.simulated_contacts import true_map

NOISE = MotionNoise()


def smoothed(shape: str, seed: int) -> tuple[ContactMap, ContactMap]:
    """The true map, and the map with poses smoothed from there, the first grasp's being given."""
    true = true_map(shape, seed, count=12)
    faces = smoothed_with_faces(true, NOISE) if shape != "ellipse" else None
    rows = PoseEvidence(true, NOISE).maximise(true.rows, 60)[0] if faces is None else faces.rows
    return true, true.with_rows(rows)


def nees(errors: Array, covariances: Array) -> Array:
    return np.array([error @ np.linalg.solve(each, error) for error, each in zip(errors, covariances, strict=True)])


def in_common_frame(true: ContactMap, found: ContactMap) -> Array:
    """Errors of the poses after the mean difference of the object frames is taken away, shape (n, 3)."""
    space = true.space
    offsets = space.compose(space.inverse(true.rows), found.rows)
    mean = np.tile(offsets.mean(axis=0), (len(offsets), 1))
    return space.deviation(found.rows, space.compose(true.rows, mean))


def test_covariances_hold_the_errors_in_both_frames_as_often_as_they_say() -> None:
    birth, common = [], []
    for shape, seed in (("rectangle", 1), ("L", 2), ("ellipse", 3), ("pentagon", 4), ("trapezoid", 5), ("hexagon", 6)):
        true, found = smoothed(shape, seed)
        covariances = PoseCovariances.of(found, NOISE)
        birth.append(nees(true.space.deviation(found.rows, true.rows)[1:], covariances.birth[1:]))
        common.append(nees(in_common_frame(true, found), covariances.common))
    for each in (birth, common):
        values = np.concatenate(each)
        assert 0.35 < np.mean(values < chi2.ppf(0.5, 3)) < 0.75
        assert np.mean(values < chi2.ppf(0.95, 3)) > 0.85


def test_the_first_pose_is_given_in_its_own_frame_and_not_in_the_common_one() -> None:
    _, found = smoothed("rectangle", 1)
    covariances = PoseCovariances.of(found, NOISE)
    assert not covariances.birth[0].any()
    assert np.linalg.eigvalsh(covariances.common).min() > 0
    assert np.trace(covariances.common[5]) < np.trace(covariances.birth[5])
    told = with_covariances(found, covariances.birth)
    np.testing.assert_array_equal(told.placed[5].covariance, covariances.birth[5])


def test_an_error_of_the_palm_adds_to_each_pose_and_the_first_ones_to_all() -> None:
    _, found = smoothed("rectangle", 1)
    alone, with_palm = PoseCovariances.of(found, NOISE), PoseCovariances.of(found, MotionNoise(palm_m=0.002))
    more = with_palm.birth - alone.birth
    np.testing.assert_allclose(more[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(more[1:, :2, :2], np.tile(2 * 0.002**2 * np.eye(2), (11, 1, 1)), rtol=1e-4, atol=1e-12)
    np.testing.assert_allclose(more[:, 2, 2], 0.0, atol=1e-9)
    spread = (with_palm.common - alone.common)[:, :2, :2].trace(axis1=1, axis2=2)
    np.testing.assert_allclose(spread, 2 * 0.002**2 * (1 - 1 / 12), rtol=1e-3)


@pytest.mark.parametrize("count", [1, 2])
def test_few_grasps_have_covariances_too(count: int) -> None:
    covariances = PoseCovariances.of(true_map("rectangle", 1, count=count), NOISE)
    assert np.isfinite(covariances.common).all()
    assert len(covariances.birth) == count
