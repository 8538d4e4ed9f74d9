"""What grasps can tell of a polygon at all."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.runs.limits.contour_limit import limit_of_contour

pytestmark = pytest.mark.long  # means over seeds


@cache
def hausdorff_mm(setting: tuple[tuple[str, Any], ...], seed: int) -> float:
    """Of one run; several tests ask for the same."""
    return float(limit_of_contour(Cell(setting, seed))["hausdorff_mm"])


def error_mm(
    shape: str, *, method: str = "known-pose", sides: str = "free", noise: int = 100, grasps: int = 16, seeds: int = 8
) -> float:
    """The mean Hausdorff distance over some seeds."""
    setting = (("noise", noise), ("sides", sides), ("shape", shape), ("method", method), ("grasps", grasps))
    return float(np.mean([hausdorff_mm(setting, seed) for seed in range(seeds)]))


@pytest.mark.parametrize("shape", ["triangle", "L", "hexagon"])
def test_four_times_the_contacts_halve_the_error(shape: str) -> None:
    assert error_mm(shape, grasps=64) == pytest.approx(error_mm(shape) / 2, rel=0.45)


@pytest.mark.parametrize("shape", ["triangle", "hexagon"])
def test_poses_that_have_to_be_estimated_cost_accuracy(shape: str) -> None:
    known = error_mm(shape, seeds=24)
    assert 1.1 * known < error_mm(shape, method="estimated-pose", seeds=24) < 3 * known


def test_poses_that_hardly_slip_are_as_good_as_known_ones() -> None:
    known, estimated = (error_mm("triangle", noise=1, method=method) for method in ("known-pose", "estimated-pose"))
    assert estimated == pytest.approx(known, rel=0.35)


def test_right_angles_that_are_told_help_who_has_them() -> None:
    assert error_mm("rectangle", sides="regular") < 0.6 * error_mm("rectangle")
    assert error_mm("hexagon", sides="regular") == pytest.approx(error_mm("hexagon"), rel=0.35)


def test_a_side_without_contacts_may_be_anywhere_in_the_hand() -> None:
    assert error_mm("L", grasps=1) > 5 * error_mm("L")


def test_the_same_seed_gives_the_same() -> None:
    first = error_mm("pentagon")
    hausdorff_mm.cache_clear()
    assert error_mm("pentagon") == first
