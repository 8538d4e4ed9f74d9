"""Settings and limits of a session."""

from __future__ import annotations

from pydantic import Field

from drivers.core.configuration import StrictModel
from sessions.conductor.guided_settings import GuidedSettings
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.probing.box_prober import ProbingSettings
from sessions.motion.safety import SafetySettings


class ConductorSettings(StrictModel):
    """A session.

    Attributes:
        grasps: number of grasps.
        fixed_grasps: number of first grasps that follow the fixed rule instead of the estimate.
        missed_approaches: number of blocked approaches in a row that ends the session.
        weighings: number of first grasps in which the held object is dragged and lifted a little, until it is weighed.
        cycle, probing, safety, guided: see there.
    """

    grasps: int = Field(default=16, ge=1)
    fixed_grasps: int = Field(default=2, ge=1)
    missed_approaches: int = Field(default=6, ge=1)
    weighings: int = Field(default=0, ge=0)
    cycle: CycleSettings = CycleSettings()
    probing: ProbingSettings = ProbingSettings()
    safety: SafetySettings = SafetySettings()
    guided: GuidedSettings = GuidedSettings()
