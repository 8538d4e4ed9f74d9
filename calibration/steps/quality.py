"""Quality of a calibration: residuals, errors of held-out poses, repeatability, and a verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from gtsam import Pose3
from pydantic import Field
from scipy.stats import chi2

from calibration.steps.pose_residuals import PoseResidual, rms_m, rms_rad
from calibration.steps.refinement import Solution
from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.poses import rotation_angle_rad

FOLDS = 5
CONFIDENCE = 0.95


class Problem(Protocol):
    """A problem that can be solved from all of its observations, or from some."""

    @property
    def count(self) -> int: ...
    def solve(self, keep: Sequence[int] | None = None, near: Solution | None = None) -> Solution: ...
    def residuals(self, solution: Solution) -> tuple[PoseResidual, ...]: ...


class QualityLimits(StrictModel):
    """Limits of a result.

    Attributes:
        residual_mm, residual_deg: root mean square over the poses.
        held_out_mm, held_out_deg: the same for poses held out of the solution.
        repeat_mm, repeat_deg: largest change of the result when one pose is left out.
        region_mm, region_deg: largest half-axis of the 95 % region.
    """

    residual_mm: float = Field(default=2.5, gt=0.0)
    residual_deg: float = Field(default=15.0, gt=0.0)
    held_out_mm: float = Field(default=3.0, gt=0.0)
    held_out_deg: float = Field(default=15.0, gt=0.0)
    repeat_mm: float = Field(default=1.0, gt=0.0)
    repeat_deg: float = Field(default=0.4, gt=0.0)
    region_mm: float = Field(default=3.0, gt=0.0)
    region_deg: float = Field(default=1.0, gt=0.0)


VIEW_LIMITS = {"residual_mm": 5.0, "residual_deg": 2.5, "held_out_mm": 5.5, "held_out_deg": 2.5}
"""Limits of pictures and pose pairs where they differ: a board seen once from far away is less
accurate than a touch.
"""


@dataclass(frozen=True)
class Judgement:
    """One value against its limit."""

    name: str
    value: float
    limit: float
    unit: str

    @property
    def ok(self) -> bool:
        """Whether it is within the limit (NaN is not)."""
        return self.value <= self.limit

    def __str__(self) -> str:
        return f"{self.name} {self.value:.2f} {self.unit}, limit {self.limit:.2f}"


@dataclass(frozen=True)
class Quality:
    """All quality values of one result.

    Attributes:
        residuals: of each pose.
        residual_m, residual_rad: root mean square; the angle None where the observations have none.
        held_out_m, held_out_rad: of poses left out of the solution, in five parts.
        repeat_m, repeat_rad: largest change of the result when one pose is left out.
        region_m, region_rad: half-axes of the 95 % region of the place and of the rotation, each (3,), largest last.
        outliers: labels of poses that the robust loss distrusts.
        judgements: the values against their limits.
    """

    residuals: tuple[PoseResidual, ...]
    residual_m: float
    residual_rad: float | None
    held_out_m: float
    held_out_rad: float | None
    repeat_m: float
    repeat_rad: float
    region_m: tuple[float, float, float]
    region_rad: tuple[float, float, float]
    outliers: tuple[str, ...]
    judgements: tuple[Judgement, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether every value is within its limit."""
        return all(judgement.ok for judgement in self.judgements)


def judge(
    problem: Problem,
    solution: Solution,
    limits: QualityLimits | None = None,
    each: Callable[[], object] = lambda: None,
) -> Quality:
    """Compute the quality of a result: one solution for each pose and each part left out.

    Args:
        problem, solution: the problem, and its solution from all observations.
        limits: of the result.
        each: called after every solution, for a progress bar; there are :func:`judging_steps` of them.
    """
    residuals = problem.residuals(solution)
    held_out = _held_out_residuals(problem, solution, each)
    repeats = _leave_one_out(problem, solution, each)
    shifts = [solution.world_T_mount.between(pose) for pose in repeats]
    quality = Quality(
        residuals=residuals,
        residual_m=rms_m(residuals),
        residual_rad=rms_rad(residuals),
        held_out_m=rms_m(held_out),
        held_out_rad=rms_rad(held_out),
        repeat_m=max(float(np.linalg.norm(shift.translation())) for shift in shifts),
        repeat_rad=max(rotation_angle_rad(shift) for shift in shifts),
        region_m=_half_axes(solution.covariance[3:, 3:]),
        region_rad=_half_axes(solution.covariance[:3, :3]),
        outliers=tuple(residuals[index].label for index in solution.outliers),
    )
    return replace(quality, judgements=_judgements(quality, limits or QualityLimits()))


def judging_steps(count: int) -> int:
    """Solutions that :func:`judge` needs for so many observations."""
    return count + min(FOLDS, count)


def region_holds(solution: Solution, truth: Pose3) -> bool:
    """Whether the 95 % region of all six numbers contains a pose."""
    off = Pose3.Logmap(solution.world_T_mount.inverse() * truth)
    return bool(off @ np.linalg.solve(solution.covariance, off) <= chi2.ppf(CONFIDENCE, 6))


def _held_out_residuals(problem: Problem, solution: Solution, each: Callable[[], object]) -> list[PoseResidual]:
    """Residuals of every pose by a solution without it."""
    found = []
    for part in range(min(FOLDS, problem.count)):
        out = range(part, problem.count, FOLDS)
        without = problem.solve([index for index in range(problem.count) if index not in out], solution)
        residuals = problem.residuals(without)
        found += [residuals[index] for index in out]
        each()
    return found


def _leave_one_out(problem: Problem, solution: Solution, each: Callable[[], object]) -> list[Pose3]:
    """The solutions with each pose left out in turn."""
    found = []
    for left in range(problem.count):
        keep = [index for index in range(problem.count) if index != left]
        found.append(problem.solve(keep, solution).world_T_mount)
        each()
    return found


def _half_axes(covariance: Array) -> tuple[float, float, float]:
    """Half-axes of the 95 % ellipsoid of three numbers, smallest first."""
    values = np.maximum(np.linalg.eigvalsh(covariance), 0.0)
    first, second, third = np.sqrt(chi2.ppf(CONFIDENCE, 3) * values).tolist()
    return first, second, third


def _judgements(found: Quality, limits: QualityLimits) -> tuple[Judgement, ...]:
    figures = (
        ("residual", found.residual_m, limits.residual_mm, found.residual_rad, limits.residual_deg),
        ("held-out residual", found.held_out_m, limits.held_out_mm, found.held_out_rad, limits.held_out_deg),
        ("leave-one-out change", found.repeat_m, limits.repeat_mm, found.repeat_rad, limits.repeat_deg),
        ("95 % region", found.region_m[-1], limits.region_mm, found.region_rad[-1], limits.region_deg),
    )
    judged = []
    for name, metres, limit_mm, radians, limit_deg in figures:
        judged.append(Judgement(name, 1e3 * metres, limit_mm, "mm"))
        if radians is not None:
            judged.append(Judgement(name, float(np.degrees(radians)), limit_deg, "deg"))
    return tuple(judged)
