"""Moments of straight runs, turned by quarter turns."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tactile_lab.slam.shape.planar.runs import chi_square_at, direction_variance, turn_back


@given(arrays(float, 6, elements=st.floats(-3, 3)), st.integers(-7, 7), st.floats(-3, 3))
def test_a_face_turned_back_is_as_good_in_the_turned_direction(moments: np.ndarray, turns: int, angle: float) -> None:
    turned = turn_back(moments, turns)
    assert chi_square_at(angle - turns * np.pi / 2, turned) == pytest.approx(chi_square_at(angle, moments), abs=1e-9)


def test_the_variance_is_the_curvatures() -> None:
    moments, step = np.array([0.2, 0.1, 0.5, 30.0, 4.0, 60.0]), 1e-3
    before, here, after = (chi_square_at(0.13 + offset, moments) for offset in (-step, 0.0, step))
    assert direction_variance(0.13, moments) == pytest.approx(2 * step**2 / (before - 2 * here + after), rel=0.02)
