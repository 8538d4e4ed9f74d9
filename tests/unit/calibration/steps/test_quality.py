"""What a calibration is judged by, on a problem whose solution is the mean of its observations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import gtsam
import numpy as np
import pytest
from gtsam import Pose3, Rot3
from scipy.stats import chi2

from calibration.steps.pose_residuals import PoseResidual
from calibration.steps.quality import Judgement, QualityLimits, judge, judging_steps, region_holds
from calibration.steps.refinement import Solution

COVARIANCE = np.diag([1e-6, 4e-6, 9e-6, 1e-8, 4e-8, 9e-8])


@dataclass
class Means:
    """Observations of a place along x, m, and of a turn about z, rad: both solved by their means."""

    places_m: Sequence[float]
    turns_rad: Sequence[float]
    solved: list[list[int]] = field(default_factory=list)

    @property
    def count(self) -> int:
        return len(self.places_m)

    def solve(self, keep: Sequence[int] | None = None, near: Solution | None = None) -> Solution:
        kept = list(range(self.count)) if keep is None else list(keep)
        self.solved.append(kept)
        place, turn = (float(np.mean(np.array(seen)[kept])) for seen in (self.places_m, self.turns_rad))
        pose = Pose3(Rot3.Rz(turn), np.array([place, 0.0, 0.0]))
        return Solution(pose, COVARIANCE, {}, 1.0, gtsam.Values(), outliers=(1,))

    def residuals(self, solution: Solution) -> tuple[PoseResidual, ...]:
        place, turn = solution.world_T_mount.x(), solution.world_T_mount.rotation().yaw()
        return tuple(
            PoseResidual(f"pose {number + 1}", abs(x - place), abs(a - turn))
            for number, (x, a) in enumerate(zip(self.places_m, self.turns_rad, strict=True))
        )


PLACES_m = (0.0, 0.001, 0.002, 0.003, 0.004, 0.005, 0.013)
TURNS_rad = tuple(0.01 * place / 0.001 for place in PLACES_m)  # ten milliradians where the place is a millimetre


def test_residuals_held_out_ones_and_repeats_are_those_of_the_solutions_without_them() -> None:
    problem = Means(PLACES_m, TURNS_rad)
    told: list[None] = []
    quality = judge(problem, problem.solve(), each=lambda: told.append(None))
    places, mean = np.array(PLACES_m), np.mean(PLACES_m)
    assert quality.residual_m == pytest.approx(np.sqrt(np.mean((places - mean) ** 2)))
    parts = [np.arange(first, 7, 5) for first in range(5)]  # a fifth of the poses each
    without = np.array([np.mean(np.delete(places, next(part for part in parts if n in part))) for n in range(7)])
    assert quality.held_out_m == pytest.approx(np.sqrt(np.mean((places - without) ** 2)))
    alone = [np.mean(np.delete(places, n)) for n in range(7)]
    assert quality.repeat_m == pytest.approx(np.abs(alone - mean).max())
    for radians, metres in (
        (quality.residual_rad, quality.residual_m),
        (quality.held_out_rad, quality.held_out_m),
        (quality.repeat_rad, quality.repeat_m),
    ):
        assert radians == pytest.approx(10 * metres)
    assert len(told) == judging_steps(problem.count) == 7 + 5
    assert quality.outliers == ("pose 2",)


def test_few_poses_are_held_out_one_by_one() -> None:
    problem = Means(PLACES_m[:3], TURNS_rad[:3])
    assert judging_steps(problem.count) == 6
    quality = judge(problem, problem.solve())
    assert problem.solved[1:4] == problem.solved[4:] == [[1, 2], [0, 2], [0, 1]]
    assert quality.held_out_m == pytest.approx(np.sqrt(np.mean(np.square([0.0015, 0.0, 0.0015]))))


def test_regions_are_the_half_axes_that_hold_95_of_100() -> None:
    problem = Means(PLACES_m, TURNS_rad)
    quality = judge(problem, problem.solve())
    factor = np.sqrt(7.8147)  # chi square of three numbers
    assert quality.region_m == pytest.approx([1e-4 * factor, 2e-4 * factor, 3e-4 * factor], rel=1e-4)
    assert quality.region_rad == pytest.approx([1e-3 * factor, 2e-3 * factor, 3e-3 * factor], rel=1e-4)


def test_each_figure_is_judged_in_millimetres_and_degrees_by_its_own_limit() -> None:
    problem = Means(PLACES_m, TURNS_rad)
    limits = QualityLimits(
        residual_mm=1,
        residual_deg=2,
        held_out_mm=3,
        held_out_deg=4,
        repeat_mm=5,
        repeat_deg=6,
        region_mm=7,
        region_deg=8,
    )  # fmt: skip
    quality = judge(problem, problem.solve(), limits)
    expected = [
        ("residual", 1e3 * quality.residual_m, "mm"),
        ("residual", np.degrees(quality.residual_rad or 0), "deg"),
        ("held-out residual", 1e3 * quality.held_out_m, "mm"),
        ("held-out residual", np.degrees(quality.held_out_rad or 0), "deg"),
        ("leave-one-out change", 1e3 * quality.repeat_m, "mm"),
        ("leave-one-out change", np.degrees(quality.repeat_rad), "deg"),
        ("95 % region", 1e3 * quality.region_m[2], "mm"),
        ("95 % region", np.degrees(quality.region_rad[2]), "deg"),
    ]
    found = [(one.name, one.value, one.unit) for one in quality.judgements]
    assert found == [(name, pytest.approx(value), unit) for name, value, unit in expected]
    assert [one.limit for one in quality.judgements] == [1, 2, 3, 4, 5, 6, 7, 8]
    assert not quality.passed  # the residual is 4 mm


def test_observations_without_a_direction_are_judged_by_their_distance_alone() -> None:
    class Places(Means):
        def residuals(self, solution: Solution) -> tuple[PoseResidual, ...]:
            return tuple(PoseResidual(one.label, one.distance_m) for one in super().residuals(solution))

    problem = Places(PLACES_m[:3], TURNS_rad[:3])
    quality = judge(problem, problem.solve())
    assert quality.residual_rad is quality.held_out_rad is None
    assert [one.unit for one in quality.judgements] == ["mm", "mm", "mm", "deg", "mm", "deg"]


def test_a_figure_at_its_limit_passes_and_one_that_is_no_number_does_not() -> None:
    assert Judgement("residual", 2.5, 2.5, "mm").ok
    assert not Judgement("residual", 2.51, 2.5, "mm").ok
    assert not Judgement("residual", float("nan"), 2.5, "mm").ok
    assert str(Judgement("residual", 2.514, 2.5, "mm")) == "residual 2.51 mm, limit 2.50"


@pytest.mark.parametrize(("sigmas", "holds"), [(3.5, True), (3.6, False)])
def test_the_region_of_all_six_numbers_ends_at_3_55_sigma(sigmas: float, holds: bool) -> None:
    solution = Means(PLACES_m, TURNS_rad).solve()
    off = sigmas * np.array([0.0, 0.0, 0.0, 1e-4, 0.0, 0.0])
    assert chi2.ppf(0.95, 6) == pytest.approx(3.5485**2, rel=1e-3)
    assert region_holds(solution, solution.world_T_mount * Pose3.Expmap(off)) is holds
