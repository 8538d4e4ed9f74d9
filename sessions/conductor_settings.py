"""What a session of grasps is asked to do, and with what limits."""

from __future__ import annotations

from pydantic import Field

from sessions.bounding_box import ProbingSettings
from sessions.cycle_settings import CycleSettings
from sessions.explorer import ExplorationSettings
from sessions.guided.settings import GuidedSettings
from sessions.next_grasp import PlanSettings
from sessions.safety import SafetySettings
from tactile_lab.strict_yaml import StrictModel


class ConductorSettings(StrictModel):
    """A session.

    Attributes:
        grasps: how many.
        fixed_grasps: how many of them follow the fixed rule before the estimate chooses.
        missed_approaches: this many approaches in a row without a way down to the table end the session.
        plan, cycle, probing, exploration, safety, guided: see there.
    """

    grasps: int = Field(default=16, ge=1)
    fixed_grasps: int = Field(default=2, ge=1)
    missed_approaches: int = Field(default=6, ge=1)
    plan: PlanSettings = PlanSettings()
    cycle: CycleSettings = CycleSettings()
    probing: ProbingSettings = ProbingSettings()
    exploration: ExplorationSettings = ExplorationSettings()
    safety: SafetySettings = SafetySettings()
    guided: GuidedSettings = GuidedSettings()
