"""The steps of the forearm-to-world wizard: plan, measure, check the motion, solve, judge, store.

Nothing here prints or asks: the command line shows these steps in a terminal, a page may show the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any, Literal, Protocol, TypeAlias

import numpy as np
from gtsam import Pose3
from pydantic import Field

from calibration.admission import Installation
from calibration.board_problem import BoardNoise, BoardProblem
from calibration.forearm import AXES, ForearmCalibration
from calibration.motion_check import MotionNeeds, MotionReport, check_pairs, check_touches, check_views
from calibration.observations import Touch, View
from calibration.pair_problem import PairProblem
from calibration.quality import VIEW_LIMITS, Problem, Quality, QualityLimits, judge, judging_steps
from calibration.recordings import ForearmData
from calibration.refinement import Solution
from calibration.store import VALID_DAYS, CalibrationRecord, Covariance, new_record
from calibration.touch_plan import PlannedTouch
from calibration.touch_problem import TouchNoise, TouchProblem
from calibration.view_plan import PlannedView
from drivers.fingertip import RigidTransform
from tactile_lab.errors import ConfigurationError
from tactile_lab.geometry.contacts import Array
from tactile_lab.strict_yaml import StrictModel

Method = Literal["touch", "marker", "pairs", "manual"]
Planned: TypeAlias = PlannedTouch | PlannedView
Observation: TypeAlias = Touch | View


class WizardSettings(StrictModel):
    """What may be configured of the wizard.

    Attributes:
        needs: the least motion.
        limits: what a result must keep to.
        touch, board: errors of the observations.
        valid_days: how long a result may be used.
    """

    needs: MotionNeeds = MotionNeeds()
    limits: QualityLimits = QualityLimits()
    touch: TouchNoise = TouchNoise()
    board: BoardNoise = BoardNoise()
    valid_days: float = Field(default=VALID_DAYS, gt=0.0)

    def limits_for(self, method: Method) -> QualityLimits:
        """The limits; for pictures and pairs with their own residuals unless these are given."""
        if method == "touch":
            return self.limits
        return QualityLimits.model_validate({**VIEW_LIMITS, **self.limits.model_dump(exclude_unset=True)})


class Station(Protocol):
    """Where observations are made: a rig, or a person with one."""

    def measure(self, planned: Planned) -> Observation:
        """Make one planned touch or picture. Raises TactileLabError when it did not come off."""


@dataclass(frozen=True)
class Step:
    """One step to show.

    Attributes:
        number, count: of the planned ones, from 1.
        instruction: what is to be done, in words.
        planned: the touch or picture.
    """

    number: int
    count: int
    instruction: str
    planned: Planned


@dataclass(frozen=True, eq=False)
class ForearmResult:
    """A solved calibration.

    Attributes:
        method: how.
        solution: the answer.
        quality: how good it is, against the limits.
        limits: those limits.
        motion: what was solved from.
        start: the answer of the closed form.
    """

    method: Method
    solution: Solution
    quality: Quality
    limits: QualityLimits
    motion: MotionReport


@dataclass
class ForearmWizard:
    """One run through the wizard.

    Attributes:
        method: touch or marker.
        plan: what to measure.
        data: what has been measured so far, and what solving needs.
        settings: see there.
    """

    method: Literal["touch", "marker"]
    plan: Sequence[Planned]
    data: ForearmData
    settings: WizardSettings = field(default_factory=WizardSettings)
    _taken: list[tuple[int, Observation]] = field(default_factory=list)

    # --- measuring ---------------------------------------------------------------------------------------------

    def steps(self) -> tuple[Step, ...]:
        """All planned steps."""
        count = len(self.plan)
        return tuple(Step(n + 1, count, planned.instruction, planned) for n, planned in enumerate(self.plan))

    def measure(self, step: Step, station: Station) -> Observation:
        """Do one step; a step that is done again replaces its observation. Raises TactileLabError."""
        observation = station.measure(step.planned)
        self._taken = [(number, old) for number, old in self._taken if number != step.number]
        self._taken.append((step.number, observation))
        return observation

    def undo(self) -> int | None:
        """Take the last observation back; gives its step's number, None when there is none."""
        return self._taken.pop()[0] if self._taken else None

    @property
    def measured(self) -> ForearmData:
        """The data with everything measured so far."""
        found = [observation for _, observation in sorted(self._taken, key=lambda item: item[0])]
        touches = tuple(item for item in found if isinstance(item, Touch))
        views = tuple(item for item in found if isinstance(item, View))
        return replace(self.data, touches=touches, views=views)

    def motion(self) -> MotionReport:
        """What of the motion is enough by now, and what is missing."""
        return motion_of(self.measured, self.method, self.settings.needs)

    def solve(self, each: Callable[[], object] = lambda: None) -> ForearmResult:
        """Check the motion, solve, and judge. Raises ConfigurationError when the motion is not enough."""
        return solve_forearm(self.measured, self.settings, each)


# --- from data to a result -----------------------------------------------------------------------------------------


def method_of(data: ForearmData) -> Method:
    """The method that recorded data belong to."""
    return "touch" if data.touches else "marker" if data.views else "pairs"


def motion_of(data: ForearmData, method: Method, needs: MotionNeeds) -> MotionReport:
    """The motion in some data."""
    if method == "touch":
        return check_touches(data.touches, needs)
    return check_views(data.views, data.link, needs) if method == "marker" else check_pairs(data.pairs, needs)


def solving_steps(data: ForearmData) -> int:
    """How often :func:`solve_forearm` calls ``each``."""
    count = len(data.touches) + len(data.views) + len(data.pairs)
    return count + min(5, count)


def solve_forearm(
    data: ForearmData, settings: WizardSettings | None = None, each: Callable[[], object] = lambda: None
) -> ForearmResult:
    """Check the motion, solve, and judge.

    Raises:
        ConfigurationError: the motion is not enough, or the data can not be solved.
    """
    settings, method = settings or WizardSettings(), method_of(data)
    motion = motion_of(data, method, settings.needs)
    motion.refuse(f"{method} method")
    problem = problem_of(data, settings)
    solution = problem.solve()
    limits = settings.limits_for(method)
    assert judging_steps(problem) == solving_steps(data)
    return ForearmResult(method, solution, judge(problem, solution, limits, each), limits, motion)


def problem_of(data: ForearmData, settings: WizardSettings) -> Problem:
    """The problem that some data pose. Raises ConfigurationError when they lack something."""
    if data.touches:
        return TouchProblem(data.touches, settings.touch, data.guess)
    if data.pairs:
        return PairProblem(data.pairs)
    if data.camera is None or data.markers is None:
        raise ConfigurationError("pictures need the camera's lens and the markers", where="marker method")
    return BoardProblem(data.views, data.camera, data.markers, data.link, settings.board)


# --- records -------------------------------------------------------------------------------------------------------


def check_origin(data: ForearmData, here: Installation, where: str) -> None:
    """Refuse observations that were recorded on another rig or with other devices. Raises ConfigurationError."""
    hint = f"Record the poses on {here.rig}, or name the rig they are of with --rig"
    if data.rig and data.rig != here.rig:
        raise ConfigurationError(f"was recorded on rig {data.rig}, not on {here.rig}", where=where, hint=hint)
    for device, serial in data.devices.items():
        if here.devices.get(device, serial) != serial:
            what = f"was recorded with {device} {serial}, not {here.devices[device]}"
            raise ConfigurationError(what, where=where, hint=hint)


def record_of(
    result: ForearmResult,
    here: Installation,
    *,
    notes: str = "",
    valid_days: float | None = VALID_DAYS,
    now: datetime | None = None,
) -> CalibrationRecord:
    """The record of a result, for the store."""
    solution, quality = result.solution, result.quality
    return new_record(
        "forearm",
        rig=here.rig,
        devices={device: serial for device, serial in here.devices.items() if device in ("hand", "base", "camera")},
        method=result.method,
        parameters=ForearmCalibration.of(solution.world_T_mount, solution.covariance),
        covariance=Covariance.from_matrix(AXES, solution.covariance),
        residuals=_residuals(quality),
        limits=result.limits.model_dump(),
        verdict="PASS" if quality.passed else "FAIL",
        details=_details(result),
        notes=notes,
        valid_days=valid_days,
        now=now,
    )


def manual_record(
    world_T_mount: Pose3,
    translation_sigma_m: float,
    rotation_sigma_rad: float,
    here: Installation,
    *,
    notes: str = "",
    valid_days: float | None = VALID_DAYS,
    now: datetime | None = None,
) -> CalibrationRecord:
    """The record of a pose that a person states, with the uncertainty that they state."""
    covariance = np.diag(np.repeat([rotation_sigma_rad, translation_sigma_m], 3) ** 2)
    return new_record(
        "forearm",
        rig=here.rig,
        devices={device: serial for device, serial in here.devices.items() if device in ("hand", "base")},
        method="manual",
        parameters=ForearmCalibration.of(world_T_mount, covariance),
        covariance=Covariance.from_matrix(AXES, covariance),
        verdict="PASS",
        details={
            "stated_sigma_mm": 1e3 * translation_sigma_m,
            "stated_sigma_deg": float(np.degrees(rotation_sigma_rad)),
        },
        notes=notes,
        valid_days=valid_days,
        now=now,
    )


def target_file(out: Path, record: CalibrationRecord) -> Path:
    """Where a record goes: its file, or beside it when it failed, so that it replaces nothing that passed."""
    return out if record.verdict == "PASS" else out.with_name(f"{out.stem}.failed{out.suffix}")


def _residuals(quality: Quality) -> dict[str, Any]:
    def degrees(value: float | None) -> float | None:
        return None if value is None else float(np.degrees(value))

    return {
        "rms_mm": 1e3 * quality.residual_m,
        "rms_deg": degrees(quality.residual_rad),
        "held_out_mm": 1e3 * quality.held_out_m,
        "held_out_deg": degrees(quality.held_out_rad),
        "leave_one_out_mm": 1e3 * quality.repeat_m,
        "leave_one_out_deg": degrees(quality.repeat_rad),
        "region_95_mm": [1e3 * axis for axis in quality.region_m],
        "region_95_deg": [float(np.degrees(axis)) for axis in quality.region_rad],
        "outliers": list(quality.outliers),
        "poses": [
            {"pose": r.label, "mm": 1e3 * r.distance_m, "deg": degrees(r.angle_rad), "px": r.pixels}
            for r in quality.residuals
        ],
    }


def _details(result: ForearmResult) -> dict[str, Any]:
    offsets: Mapping[str, Any] = {
        joint: {
            "deg": float(np.degrees(offset.offset_rad)),
            "sigma_deg": float(np.degrees(offset.sigma_rad)),
            "observable": offset.observable,
        }
        for joint, offset in result.solution.offsets.items()
    }
    return {
        "variance_factor": result.solution.variance_factor,
        "joint_offsets": dict(offsets),
        **result.solution.numbers,
        **{name: _transform(pose) for name, pose in result.solution.others.items()},
        "motion": {check.name: check.value for check in result.motion.checks},
    }


def _transform(pose: Pose3) -> dict[str, list[float]]:
    rotation: Array = pose.rotation().xyz()
    return {
        "translation_m": [float(value) for value in pose.translation()],
        "rpy_rad": [float(value) for value in rotation],
    }


def transform_of(translation_m: Sequence[float], rpy_deg: Sequence[float]) -> Pose3:
    """A pose from metres and degrees, roll, pitch, yaw about fixed axes."""
    x, y, z = translation_m
    roll, pitch, yaw = np.radians(rpy_deg).tolist()
    return RigidTransform(translation_m=(x, y, z), rpy_rad=(roll, pitch, yaw)).pose()
