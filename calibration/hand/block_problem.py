"""Joint offsets from several fingers on one rigid block at a known pose, with a calibrated forearm.

The forearm's calibration was taken with the wrist held, and has taken its offsets in; it is an unknown here only as far
as it is unsure. Without it an offset that all fingers share would look like a turn of the palm.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import gtsam
import numpy as np
from gtsam import Pose3
from pydantic import Field

from calibration.forearm.placement import ForearmCalibration
from calibration.forearm.touch_problem import TouchNoise, TouchProblem
from calibration.forearm.wizard import Observation, Planned
from calibration.steps.guided_steps import GuidedSteps
from calibration.steps.hand_chain import WRIST
from calibration.steps.motion_check import Check, MotionReport
from calibration.steps.observations import Touch
from calibration.steps.pose_residuals import rms_m
from calibration.steps.quality import Judgement
from calibration.steps.refinement import MOUNT, OFFSETS, Evaluation, JointOffset, Measurement, Solution, marginal
from calibration.store.store import Covariance
from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array

_WRIST_rad = float(np.radians(0.05))
"""Possible motion of the wrist since the forearm's calibration."""

_LEAST_SIGMAS = np.repeat([np.radians(0.02), 1e-4], 3)
"""Least error of the forearm's calibration, radians and metres."""


class BlockLimits(StrictModel):
    """Limits of touches of a block, for trusting the joints' offsets found from them.

    Attributes:
        residual_mm: residual of the touches, root mean square.
        noise: of the residuals, of what was stated.
        outliers: share of touches that the robust loss distrusts.
    """

    residual_mm: float = Field(default=0.6, gt=0.0)
    noise: float = Field(default=1.5, gt=0.0)
    outliers: float = Field(default=0.1, ge=0.0)


class BlockSettings(StrictModel):
    """Settings of the joints' calibration by a block.

    Attributes:
        noise: errors of the touches.
        limits: see there.
        touches: the least of each finger.
    """

    noise: TouchNoise = TouchNoise(point_sigma_m=2e-4)
    limits: BlockLimits = BlockLimits()
    touches: int = Field(default=8, ge=6)


@dataclass(frozen=True, eq=False)
class BlockResult:
    """Joint offsets from a block.

    Attributes:
        offsets: of the fingers' joints, the unobservable ones too.
        covariance: of all of them, scaled by what the residuals say of the noise, radians.
        judgements: the touches against their limits.
    """

    offsets: Mapping[str, JointOffset]
    covariance: Covariance
    judgements: tuple[Judgement, ...]

    @property
    def passed(self) -> bool:
        """Whether every figure keeps to its limit."""
        return all(judgement.ok for judgement in self.judgements)


@dataclass
class BlockWizard(GuidedSteps[Planned, Observation]):
    """One run through the wizard.

    Attributes:
        plan: what to touch.
        settings: see there.
    """

    plan: Sequence[Planned]
    settings: BlockSettings = field(default_factory=BlockSettings)
    _taken: list[tuple[int, Observation]] = field(default_factory=list)

    @property
    def touches(self) -> tuple[Touch, ...]:
        """All that have been measured so far."""
        return tuple(found for _, found in self.observations() if isinstance(found, Touch))

    def motion(self) -> MotionReport:
        """Whether the touches are sufficient, and what is missing."""
        return block_motion(self.touches, self.settings)


def is_of_block(touches: Sequence[Touch]) -> bool:
    """Whether touches are of a block alone."""
    return bool(touches) and all(touch.target.name.startswith("block") for touch in touches)


def block_motion(touches: Sequence[Touch], settings: BlockSettings) -> MotionReport:
    """Number of fingers, touches of each, and faces."""
    fingers = Counter(touch.finger for touch in touches)
    faces = {touch.target.name for touch in touches}
    return MotionReport(
        (
            Check("fingers", len(fingers), 2, "", "press with two fingers or more"),
            Check("touches of each finger", min(fingers.values(), default=0), settings.touches, "", "press more"),
            Check("faces", len(faces), 5, "", "press the top and all four sides"),
        )
    )


def solve_block(touches: Sequence[Touch], forearm: ForearmCalibration, settings: BlockSettings) -> BlockResult:
    """Joint offsets, their covariance, and whether the touches fit.

    Raises:
        ConfigurationError: too few touches, fingers or faces.
    """
    block_motion(touches, settings).refuse("block")
    spread = forearm.covariance() + np.diag(_LEAST_SIGMAS**2)
    problem = BlockProblem(touches, forearm.world_T_mount.pose(), spread, settings.noise)
    return problem.result(problem.solve(), settings.limits)


class BlockProblem(TouchProblem):
    """All touches of the block.

    Args:
        touches: of the block's faces.
        world_T_mount: the forearm's calibration.
        covariance: of a small motion on the mount's side, rotation first, shape (6, 6).
        noise: errors of the touches.
    """

    def __init__(
        self, touches: Sequence[Touch], world_T_mount: Pose3, covariance: Array, noise: TouchNoise | None = None
    ) -> None:
        super().__init__(touches, noise, world_T_mount)
        self._start = world_T_mount
        self._known = Measurement((MOUNT,), covariance, _off(world_T_mount), robust=False)

    def _measurements(self, chosen: Sequence[int], values: gtsam.Values) -> list[Measurement]:
        *touches, offsets = super()._measurements(chosen, values)
        return [*touches, self._known, offsets]

    def result(self, solution: Solution, limits: BlockLimits) -> BlockResult:
        """The fingers' joints of a solution, and the touches against their limits."""
        rows = [row for row, joint in enumerate(self.joints) if joint not in WRIST]
        measured = self._measurements(range(self.count), solution.values)
        spread = max(1.0, solution.variance_factor) * marginal(measured, solution.values, OFFSETS)[np.ix_(rows, rows)]
        names = [self.joints[row] for row in rows]
        offsets = {
            joint: JointOffset(solution.offsets[joint].offset_rad, float(np.sqrt(spread[i, i])), self._prior_rad)
            for i, joint in enumerate(names)
        }
        figures = (
            Judgement("residual", 1e3 * rms_m(self.residuals(solution)), limits.residual_mm, "mm"),
            Judgement("noise relative to the stated", float(np.sqrt(solution.variance_factor)), limits.noise, ""),
            Judgement("share of outliers", len(solution.outliers) / self.count, limits.outliers, ""),
        )
        return BlockResult(offsets, Covariance.from_matrix(tuple(f"{name}_rad" for name in names), spread), figures)

    @property
    def _prior_rad(self) -> float:
        return self.noise.joint_offset_rad

    @property
    def _joint_sigmas(self) -> Array:
        return np.array([_WRIST_rad if joint in WRIST else self._prior_rad for joint in self.joints])


def _off(known: Pose3) -> Evaluation:
    """How far the mount is from its calibration, to first order."""

    def evaluate(values: gtsam.Values) -> tuple[Array, list[Array]]:
        return Pose3.Logmap(known.inverse() * values.atPose3(MOUNT)), [np.eye(6)]

    return evaluate
