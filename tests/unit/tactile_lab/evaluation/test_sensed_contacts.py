"""Contacts as they were felt, seen in the true object's frame."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose3, Rot3

from tactile_lab.evaluation.shape import contact_height_m, outline_distances_m

SQUARE_m = np.array([[-0.02, -0.02], [0.02, -0.02], [0.02, 0.02], [-0.02, 0.02]])
MOVED = Pose3(Rot3.Rz(np.pi / 2), np.array([0.3, 0.1, 0.05]))


def test_heights_are_those_above_the_true_object_s_origin() -> None:
    first = np.array([[0.3, 0.1, 0.06], [0.3, 0.1, 0.08]])
    assert contact_height_m([first, first[:1]], [MOVED, Pose3()]) == pytest.approx((0.01 + 0.03 + 0.06) / 3)


def test_without_contacts_the_height_is_zero_and_there_are_no_distances() -> None:
    assert contact_height_m([], []) == 0.0
    assert contact_height_m([np.zeros((0, 3))], [MOVED]) == 0.0
    assert outline_distances_m([], [], SQUARE_m).shape == (0,)


def test_distances_are_those_from_the_outline_where_the_object_truly_was() -> None:
    felt = MOVED.transformFrom(np.array([0.023, 0.0, 0.01]))[None]
    np.testing.assert_allclose(outline_distances_m([felt], [MOVED], SQUARE_m), [0.003], atol=1e-9)
