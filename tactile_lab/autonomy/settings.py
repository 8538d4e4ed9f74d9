"""Settings of a session with an estimator: those of the session and of the planners."""

from __future__ import annotations

from sessions.conductor.settings import ConductorSettings
from tactile_lab.autonomy.heuristic_planner import PlanSettings
from tactile_lab.autonomy.variance_planner import ExplorationSettings


class SessionSettings(ConductorSettings):
    """A session whose grasps are planned by the estimate; the section ``conductor`` of a rig file.

    Attributes:
        plan, exploration: see there.
    """

    plan: PlanSettings = PlanSettings()
    exploration: ExplorationSettings = ExplorationSettings()
