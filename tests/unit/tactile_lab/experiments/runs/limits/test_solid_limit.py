"""What grasps can tell of a solid with flat faces at all."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.runs.limits.solid_limit import limit_of_solid

pytestmark = pytest.mark.long  # means over seeds


@cache
def figures(setting: tuple[tuple[str, Any], ...], seed: int) -> dict[str, Any]:
    """Of one run; several tests ask for the same."""
    return limit_of_solid(Cell(setting, seed))


def mean_mm(
    figure: str,
    shape: str,
    *,
    method: str = "estimated-pose",
    sides: str = "regular",
    noise: int = 100,
    grasps: int = 24,
) -> float:
    """A figure's mean over some seeds."""
    setting = (("noise", noise), ("sides", sides), ("shape", shape), ("method", method), ("grasps", grasps))
    return float(np.mean([figures(setting, seed)[figure] for seed in range(6)]))


@pytest.mark.parametrize("shape", ["triangular-prism", "l-block"])
def test_known_poses_are_exact_and_four_times_the_contacts_halve_the_error(shape: str) -> None:
    assert mean_mm("registration_mm", shape, method="known-pose") == pytest.approx(0.0, abs=1e-9)
    few, many = (mean_mm("hausdorff_mm", shape, method="known-pose", grasps=count) for count in (12, 48))
    assert many == pytest.approx(few / 2, rel=0.4)


@pytest.mark.parametrize("shape", ["triangular-prism", "l-block"])
def test_poses_that_have_to_be_estimated_cost_accuracy(shape: str) -> None:
    known = mean_mm("hausdorff_mm", shape, method="known-pose")
    assert 1.1 * known < mean_mm("hausdorff_mm", shape) < 4 * known


def test_a_long_box_slides_farther_along_its_sides_than_a_prism() -> None:
    assert mean_mm("registration_mm", "box-12x6x6") > 1.4 * mean_mm("registration_mm", "triangular-prism")


def test_poses_that_hardly_slip_are_hardly_unknown() -> None:
    assert mean_mm("registration_mm", "l-block", noise=1) < 0.15 * mean_mm("registration_mm", "l-block")


def test_upright_walls_and_right_angles_that_are_told_help() -> None:
    assert mean_mm("hausdorff_mm", "box-12x6x6") < 0.5 * mean_mm("hausdorff_mm", "box-12x6x6", sides="free")
