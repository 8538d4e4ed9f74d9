"""The steps of the fingertip wizard: plan, measure, check the motion, solve. Nothing here prints or asks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from calibration.fingertip.data import FingertipData, WrenchPose
from calibration.fingertip.fit import FingertipFit, fit_fingertip, wrench_motion
from calibration.fingertip.model import FingertipNoise
from calibration.fingertip.plan import PlannedWrench
from calibration.steps.guided_steps import GuidedSteps
from calibration.steps.motion_check import MotionReport
from drivers.core.fingertip import FingertipCalibration


@dataclass
class FingertipWizard(GuidedSteps[PlannedWrench, tuple[WrenchPose, ...]]):
    """One run through the wizard. A step gives a free wrench, and that of the press after it if it plans one.

    Attributes:
        plan: what to measure.
        data: rig, finger and serial number; its wrenches are replaced by those that are measured.
        before: the fingertip's calibration so far.
        noise: errors of the wrenches.
    """

    plan: Sequence[PlannedWrench]
    data: FingertipData
    before: FingertipCalibration
    noise: FingertipNoise = field(default_factory=FingertipNoise)
    _taken: list[tuple[int, tuple[WrenchPose, ...]]] = field(default_factory=list)

    @property
    def measured(self) -> FingertipData:
        """The data with everything measured so far."""
        found = [felt for _, felt in self.observations()]
        free = tuple(felt[0] for felt in found)
        presses = tuple(felt[1] for felt in found if len(felt) > 1)
        return self.data.model_copy(update={"free": free, "presses": presses})

    def motion(self) -> MotionReport:
        """Whether the orientations are sufficient, and what is missing."""
        return wrench_motion(self.measured)

    def solve(self) -> FingertipFit:
        """Mounting, weight and shape. Raises ConfigurationError if the wrenches do not determine them."""
        return fit_fingertip(self.measured, self.before, self.noise)
