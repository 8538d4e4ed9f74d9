"""Simulated sessions of a hand whose fingers each have an error of their own throughout."""

from __future__ import annotations

import numpy as np
import pytest

from tactile_lab.experiments.data.planar_data import simulate
from tactile_lab.experiments.data.sensing import POINT_SIGMA_m, with_finger_errors

SIGMA_m = 0.0008


def test_all_contacts_of_a_finger_move_along_their_normals_by_one_error_and_state_it() -> None:
    before = simulate("L", 1, count=4)
    after = with_finger_errors(before, SIGMA_m, np.random.default_rng(5))
    steps: dict[str, list[float]] = {}
    for plain, moved in zip(before.grasps, after.grasps, strict=True):
        for one, other in zip(plain.contacts, moved.contacts, strict=True):
            step, normal = other.point_world_m - one.point_world_m, one.normal_world
            steps.setdefault(one.finger, []).append(float(step @ normal))
            np.testing.assert_allclose(step, steps[one.finger][-1] * normal, atol=1e-12)
            assert other.shared_moves_m is not None
            np.testing.assert_allclose(other.shared_moves_m, SIGMA_m * normal[:, None], atol=1e-12)
            assert normal @ other.point_covariance_m2 @ normal == pytest.approx(SIGMA_m**2 + POINT_SIGMA_m**2)
    errors_m = np.array([found[0] for found in steps.values()])
    assert all(np.ptp(found) < 1e-12 for found in steps.values())
    assert len(np.unique(errors_m)) == len(errors_m) == 5


def test_paths_end_where_their_contacts_are_felt() -> None:
    before = simulate("L", 1, count=2)
    after = with_finger_errors(before, SIGMA_m, np.random.default_rng(5))
    for plain, moved in zip(before.grasps, after.grasps, strict=True):
        steps = {
            one.finger: b.point_world_m - one.point_world_m
            for one, b in zip(plain.contacts, moved.contacts, strict=True)
        }
        for line, shifted in zip(plain.approach_paths, moved.approach_paths, strict=True):
            expected = line.end_world_m + steps.get(line.finger, np.zeros(3))
            np.testing.assert_allclose(shifted.end_world_m, expected, atol=1e-12)
