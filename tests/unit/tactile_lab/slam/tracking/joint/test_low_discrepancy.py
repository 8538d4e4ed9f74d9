from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import qmc

from tactile_lab.slam.tracking.joint.low_discrepancy import MOST_DIMENSIONS, sobol_points


@pytest.mark.parametrize("dimensions", range(1, MOST_DIMENSIONS + 1))
@pytest.mark.parametrize("exponent", [0, 1, 5, 10])
def test_points_are_those_of_scipy_to_the_last_bit(dimensions: int, exponent: int) -> None:
    expected = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(dimensions)).random_base2(exponent)
    found = sobol_points(1 << exponent, dimensions, np.random.default_rng(dimensions).spawn(1)[0])
    np.testing.assert_array_equal(found, expected, strict=True)


@pytest.mark.parametrize("dimensions", [1, 3, 6])
def test_every_part_of_the_unit_interval_has_one_point(dimensions: int) -> None:
    points = sobol_points(64, dimensions, np.random.default_rng(7))
    assert np.array_equal(np.sort(np.floor(points * 64), axis=0), np.tile(np.arange(64.0)[:, None], dimensions))


def test_the_first_points_are_the_same_whatever_their_number() -> None:
    many, few = (sobol_points(count, 3, np.random.default_rng(1)) for count in (100, 37))
    np.testing.assert_array_equal(many[:37], few)
