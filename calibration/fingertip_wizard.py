"""The steps of the fingertip wizard: plan, measure, check the motion, solve. Nothing here prints or asks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from calibration.fingertip_data import FingertipData, WrenchPose
from calibration.fingertip_fit import FingertipFit, fit_fingertip, wrench_motion
from calibration.fingertip_plan import PlannedFree, PlannedWrench
from calibration.guided_steps import GuidedSteps
from calibration.motion_check import MotionReport
from drivers.fingertip import FingertipCalibration


@dataclass
class FingertipWizard(GuidedSteps[PlannedWrench, WrenchPose]):
    """One run through the wizard.

    Attributes:
        plan: what to measure.
        data: rig, finger and serial number; its wrenches are replaced by those that are measured.
        before: the fingertip's calibration so far.
    """

    plan: Sequence[PlannedWrench]
    data: FingertipData
    before: FingertipCalibration
    _taken: list[tuple[int, WrenchPose]] = field(default_factory=list)

    @property
    def measured(self) -> FingertipData:
        """The data with everything measured so far."""
        found = self.observed()
        free = tuple(wrench for planned, wrench in found if isinstance(planned, PlannedFree))
        presses = tuple(wrench for planned, wrench in found if not isinstance(planned, PlannedFree))
        return self.data.model_copy(update={"free": free, "presses": presses})

    def motion(self) -> MotionReport:
        """What of the orientations is enough by now, and what is missing."""
        return wrench_motion(self.measured)

    def solve(self) -> FingertipFit:
        """Mounting, weight and shape. Raises ConfigurationError when the wrenches do not tell them."""
        return fit_fingertip(self.measured, self.before)
