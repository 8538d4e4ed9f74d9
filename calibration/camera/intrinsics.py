"""A lens from views of a board: OpenCV's calibration with standard deviations, held-out views, and a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from calibration.camera.views import BoardView, Coverage, coverage
from drivers.camera.calibration import CameraCalibration
from drivers.camera.opencv import cv2
from drivers.camera.pose.board_pose import board_pose
from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError

PARAMETERS = ("fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "p1", "p2", "k3")
_HELD_OUT_EVERY = 4
_FEWEST_VIEWS = 5
_OUTLIER, _OUTLIER_FLOOR_px = 3.0, 0.5


class LensLimits(StrictModel):
    """Limits of a lens calibration.

    Attributes:
        views: least number of views.
        reprojection_px: root mean square error of all corners.
        held_out_px: the same for views not used for the lens (only for their poses).
        focal_percent: standard deviation of the focal lengths over themselves.
        centre_px: standard deviation of the principal point, for a picture 1000 pixels wide.
    """

    views: int = Field(default=12, ge=_FEWEST_VIEWS)
    reprojection_px: float = Field(default=0.5, gt=0.0)
    held_out_px: float = Field(default=0.6, gt=0.0)
    focal_percent: float = Field(default=0.3, gt=0.0)
    centre_px: float = Field(default=3.0, gt=0.0)


@dataclass(frozen=True, eq=False)
class LensResult:
    """The result of a lens calibration.

    Attributes:
        lens: the camera's calibration.
        sigmas: standard deviation of each of :data:`PARAMETERS` that was free, by name.
        per_view_px: error of each used view, by name.
        reprojection_px: root mean square error of all corners.
        held_out_px: the same for views held out of a second calibration.
        left_out: views that disagree with the others, with their errors.
        coverage: what the views showed.
        problems: why the result fails; empty if it passes.
    """

    lens: CameraCalibration
    sigmas: dict[str, float]
    per_view_px: dict[str, float]
    reprojection_px: float
    held_out_px: float
    left_out: dict[str, float]
    coverage: Coverage
    problems: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """Whether it passes."""
        return not self.problems


def calibrate_lens(
    views: Sequence[BoardView], limits: LensLimits | None = None, *, third_radial: bool = False
) -> LensResult:
    """A lens from views of one board, with two radial coefficients, or three.

    Raises:
        ConfigurationError: too few views to compute anything, or pictures of different sizes.
    """
    limits = limits or LensLimits()
    if len(views) < _FEWEST_VIEWS:
        what = f"{len(views)} usable views of the board, but at least {_FEWEST_VIEWS} are needed"
        raise ConfigurationError(what, where="camera calibration", hint="Show the board in more positions and tilts")
    if len({view.size_px for view in views}) > 1:
        sizes = ", ".join(sorted({"{} x {}".format(*view.size_px) for view in views}))
        hint = "Use one camera resolution"
        raise ConfigurationError(f"pictures of different sizes: {sizes}", where="camera calibration", hint=hint)
    solution = _solve(views, third_radial)
    used, left_out = _without_outliers(views, solution)
    if left_out:
        solution = _solve(used, third_radial)
    held_out_px = _held_out_error(used, third_radial)
    seen = coverage(used)
    problems = _problems(limits, used, solution, held_out_px, seen)
    per_view = {view.name: float(error) for view, error in zip(used, solution.per_view_px, strict=True)}
    return LensResult(solution.lens, solution.sigmas, per_view, solution.rms_px, held_out_px, left_out, seen, problems)


@dataclass(frozen=True, eq=False)
class _Solution:
    lens: CameraCalibration
    sigmas: dict[str, float]
    per_view_px: Array
    rms_px: float


def _solve(views: Sequence[BoardView], third_radial: bool) -> _Solution:
    size = views[0].size_px
    points = [view.points_m.astype(np.float32)[:, None] for view in views]
    pixels = [view.pixels.astype(np.float32)[:, None] for view in views]
    flags = 0 if third_radial else cv2.CALIB_FIX_K3
    try:
        rms, matrix, distortion, _, _, sigmas, _, per_view = cv2.calibrateCameraExtended(
            points, pixels, size, np.eye(3), np.zeros(5), flags=flags
        )
    except cv2.error as error:
        raise _no_lens() from error
    if not np.isfinite(sigmas).all():
        raise _no_lens(f" (reprojection error {rms:.1f} px)")
    lens = CameraCalibration(
        focal_px=(float(matrix[0, 0]), float(matrix[1, 1])),
        centre_px=(float(matrix[0, 2]), float(matrix[1, 2])),
        distortion=tuple(float(value) for value in np.ravel(distortion)[:5]),
        size_px=size,
    )
    free = len(PARAMETERS) if third_radial else len(PARAMETERS) - 1
    named = dict(zip(PARAMETERS[:free], np.ravel(sigmas).tolist(), strict=False))
    return _Solution(lens, named, np.ravel(per_view), float(rms))


def _no_lens(figures: str = "") -> ConfigurationError:
    hint = "Compare the board with its description; show it in more positions and tilts"
    return ConfigurationError(f"no lens fits the views{figures}", where="camera calibration", hint=hint)


def _without_outliers(views: Sequence[BoardView], solution: _Solution) -> tuple[list[BoardView], dict[str, float]]:
    """Consistent views, and the errors of the others."""
    limit = max(_OUTLIER * float(np.median(solution.per_view_px)), _OUTLIER_FLOOR_px)
    good = solution.per_view_px <= limit
    if good.sum() < _FEWEST_VIEWS:
        return list(views), {}
    judged = list(zip(views, solution.per_view_px, good, strict=True))
    return [view for view, _, fits in judged if fits], {view.name: float(e) for view, e, fits in judged if not fits}


def _held_out_error(views: Sequence[BoardView], third_radial: bool) -> float:
    """Error of every fourth view with a lens made from the others; NaN if too few are left."""
    kept = [view for number, view in enumerate(views) if number % _HELD_OUT_EVERY]
    if len(kept) < _FEWEST_VIEWS:
        return float("nan")
    lens = _solve(kept, third_radial).lens
    errors = []
    for view in views[::_HELD_OUT_EVERY]:
        found = board_pose(view.points_m, view.pixels, lens)
        if found is not None:
            errors.append(found.reprojection_px)
    return float(np.sqrt(np.mean(np.square(errors))))


def _problems(
    limits: LensLimits, views: Sequence[BoardView], solution: _Solution, held_out_px: float, seen: Coverage
) -> tuple[str, ...]:
    width, focal = views[0].size_px[0], solution.lens.focal_px
    focal_percent = 100 * max(solution.sigmas["fx_px"] / focal[0], solution.sigmas["fy_px"] / focal[1])
    centre_px = max(solution.sigmas["cx_px"], solution.sigmas["cy_px"]) * 1000 / width
    figures = (
        ("reprojection error", solution.rms_px, limits.reprojection_px, "px"),
        ("error of held-out views", held_out_px, limits.held_out_px, "px"),
        ("standard deviation of the focal length", focal_percent, limits.focal_percent, "%"),
        ("standard deviation of the principal point (per 1000 px)", centre_px, limits.centre_px, "px"),
    )
    problems = [
        f"{name} {value:.2f} {unit}, at most {limit:g} {unit}"
        for name, value, limit, unit in figures
        if not value <= limit
    ]
    if len(views) < limits.views:
        problems.insert(0, f"{len(views)} views, at least {limits.views}")
    return (*problems, *(f"not shown: {words}" for words in seen.missing))
