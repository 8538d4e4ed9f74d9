"""Who attends a session: an operator who guides it, or one who watches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from drivers.core.clock import MonotonicClock, VirtualClock
from sessions.conductor.decisions import SessionRoles
from sessions.conductor.policy_decisions import Approve, approve_everything, record_choices
from sessions.guided.attended import AttendedDecisions
from sessions.guided.operator import Operator
from sessions.guided.pace import Pace
from sessions.recording.recorder import TrafficSink
from sessions.rig_runtime.rig_runtime import RigRuntime
from tactile_lab.autonomy.autonomous_roles import autonomous_roles
from tactile_lab.autonomy.guided_roles import guided_roles
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.slam.tactile_slam import TactileSlam


@dataclass(frozen=True)
class Attendance:
    """Who is there.

    Attributes:
        operator: a person or a simulated one; None for nobody.
        guides: the operator decides; else the planner does, and the operator may pause, undo and end.
        led_by: how the hand is moved in a guided session; None for what the rig says.
        automatic: captures come by themselves; None for what the rig says.
        pace: simulated seconds for a real one in a guided session; 0 for as fast as it goes.
        onlookers: are given what viewers show.
        approve: asked before every grasp of an autonomous session.
    """

    operator: Operator | None = None
    guides: bool = False
    led_by: Literal["keys", "hand"] | None = None
    automatic: bool | None = None
    pace: float = 1.0
    onlookers: tuple[TrafficSink, ...] = ()
    approve: Approve = approve_everything


def settings_for(settings: SessionSettings, attendance: Attendance) -> SessionSettings:
    """The session's settings with the command line options applied."""
    asked = {"led_by": attendance.led_by, "automatic": attendance.automatic}
    changes = {name: value for name, value in asked.items() if value is not None}
    guided = settings.guided.model_copy(update=changes)
    if not attendance.guides:
        return settings
    safety = settings.safety.model_copy(update={"session_limit_s": guided.session_limit_s})
    return settings.model_copy(update={"guided": guided, "safety": safety})


def roles_for(
    attendance: Attendance,
    runtime: RigRuntime,
    slam: TactileSlam,
    settings: SessionSettings,
    session_folder: Path,
    *,
    seed: int,
    dimension: int,
) -> SessionRoles:
    """The roles that fits who is there."""
    operator = attendance.operator
    if operator is not None and attendance.guides:
        pace = _pace(runtime, attendance)
        return guided_roles(
            runtime, slam, settings, operator, session_folder, seed=seed, dimension=dimension, pace=pace
        )
    roles = autonomous_roles(runtime, slam, settings, seed=seed, dimension=dimension, approve=attendance.approve)
    if operator is None:
        return roles
    pace = _pace(runtime, attendance)
    tell, approve = record_choices(runtime), attendance.approve
    decisions = AttendedDecisions(
        roles.estimator, tell, approve, operator, roles.guard, lambda: pace(runtime.clock.now_ns())
    )
    return replace(roles, decisions=decisions)


def _pace(runtime: RigRuntime, attendance: Attendance) -> Callable[[int], None]:
    if attendance.pace > 0.0 and isinstance(runtime.clock, VirtualClock):
        return Pace(MonotonicClock(), attendance.pace)
    return lambda stamp_ns: None
