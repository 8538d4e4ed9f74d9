"""Chances that are computed without ``scipy.stats``, against it."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2, hypergeom

from tactile_lab.slam.graph.chances import (
    chi_squared_exceeded_by,
    chi_squared_quantile,
    chi_squared_tail,
    hypergeometric_tail,
)


@st.composite
def _draws(draw: st.DrawFn) -> tuple[int, int, int, int]:
    total = draw(st.integers(1, 600))
    marked, drawn = draw(st.integers(0, total)), draw(st.integers(0, total))
    return draw(st.integers(0, drawn)), total, marked, drawn


@settings(max_examples=200, deadline=None)
@given(_draws())
def test_a_tail_of_fishers_test_is_that_of_scipy(draws: tuple[int, int, int, int]) -> None:
    least, total, marked, drawn = draws
    expected = float(hypergeom.sf(least - 1, total, marked, drawn))
    assert hypergeometric_tail(least, total, marked, drawn) == pytest.approx(expected, rel=1e-8, abs=1e-200)


@pytest.mark.parametrize("degrees", [1, 2, 3, 6, 120])
def test_the_chi_squared_distribution_is_that_of_scipy(degrees: int) -> None:
    squared = np.array([0.0, 0.3, 7.0, 90.0])
    np.testing.assert_allclose(chi_squared_tail(squared, degrees), chi2.sf(squared, degrees), rtol=1e-12)
    assert chi_squared_exceeded_by(1e-6, degrees) == pytest.approx(chi2.isf(1e-6, degrees), rel=1e-9)
    assert chi_squared_quantile(0.95, degrees) == pytest.approx(chi2.ppf(0.95, degrees), rel=1e-9)


def test_a_session_starts_without_scipys_statistics() -> None:
    code = (
        "import sys, tactile_lab.workflow.running as _; "
        "from tactile_lab.slam.tracking.joint.proposals import quasi_normal; quasi_normal(96, 6); "
        "print('scipy.stats' in sys.modules)"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout == "False\n"
