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
        hypotheses: number kept from grasp to grasp.
        smoothed: number of branches, the best before smoothing, that are smoothed.
        evidence_gap: hypotheses this much less likely than the best (natural logarithm) are dropped.
        branch_gap: the same for branches before they are smoothed.
        iterations: of the optimiser at each grasp.
        final_iterations: of the optimiser at the end.
        backwards: read the session backwards as well at the end, unless it is too long for that.
        window: beyond twice this many grasps, all but this many are settled.
        estimate_motion: learn the motion's noise from the session; the configured one counts as much as six grasps.
        remembered: number of contacts of settled grasps that are kept.
        without: mechanisms that are switched off, to measure their benefit.
    """

    proposals: ProposalSettings = ProposalSettings()
    hypotheses: int = Field(default=4, ge=1)
    smoothed: int = Field(default=6, ge=1)
    evidence_gap: float = Field(default=25.0, gt=0)
    branch_gap: float = Field(default=15.0, gt=0)
    iterations: int = Field(default=15, ge=1)
    final_iterations: int = Field(default=80, ge=1)
    backwards: bool = True
    window: int = Field(default=24, ge=2)
    estimate_motion: bool = False
    remembered: int = Field(default=50, ge=10)
    without: frozenset[Mechanism] = frozenset()
