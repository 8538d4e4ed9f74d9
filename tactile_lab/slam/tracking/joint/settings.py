"""Parameters of the joint hypotheses."""

from __future__ import annotations

from pydantic import Field

from drivers.core.configuration import StrictModel
from tactile_lab.slam.tracking.joint.mechanisms import Mechanism
from tactile_lab.slam.tracking.joint.proposals import ProposalSettings


class JointSettings(StrictModel):
    """Parameters of the hypotheses.

    Attributes:
        proposals: how poses are proposed.
        hypotheses: so many are kept from grasp to grasp.
        smoothed: so many of the branches, by evidence before smoothing, are smoothed.
        evidence_gap: hypotheses that much less likely than the best (natural logarithm) are given up.
        branch_gap: the same for branches before they are smoothed.
        iterations: of the optimiser at each grasp.
        final_iterations: of the optimiser at the end.
        backwards: read the session backwards as well at the end, unless it is too long for that.
        window: beyond twice so many grasps, all but so many are settled.
        estimate_motion: learn the motion's noise from the session; the configured one counts as much as six grasps.
        remembered: so many contacts of settled grasps still count.
        without: mechanisms that are left out, to see what they are worth.
    """

    proposals: ProposalSettings = ProposalSettings()
    hypotheses: int = Field(default=4, ge=1)
    smoothed: int = Field(default=6, ge=1)
    evidence_gap: float = Field(default=25.0, gt=0)
    branch_gap: float = Field(default=15.0, gt=0)
    iterations: int = Field(default=15, ge=1)
    final_iterations: int = Field(default=80, ge=1)
    backwards: bool = True
    window: int = Field(default=12, ge=2)
    estimate_motion: bool = False
    remembered: int = Field(default=50, ge=10)
    without: frozenset[Mechanism] = frozenset()
