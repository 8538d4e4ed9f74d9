"""Who is at a session beside the program: a person who guides it, or one who watches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from sessions.autonomous_crew import autonomous_crew
from sessions.bench import Bench
from sessions.conductor_settings import ConductorSettings
from sessions.decisions import Crew
from sessions.guided.attended import AttendedDecisions
from sessions.guided.crew import guided_crew
from sessions.guided.operator import Operator
from sessions.guided.pace import Pace
from sessions.policy_decisions import Approve, everything_approved, recorded_by
from sessions.recorder import TrafficSink
from tactile_lab.clock import MonotonicClock, VirtualClock
from tactile_lab.slam import TactileSlam


@dataclass(frozen=True)
class Attendance:
    """Who is there.

    Attributes:
        operator: a person, or what stands in for one; None for nobody.
        guides: the operator decides; else the planner does, and the operator may pause, undo and end.
        led_by: how the hand is moved in a guided session; None for what the rig says.
        automatic: captures come by themselves; None for what the rig says.
        pace: simulated seconds for a real one in a guided session; 0 for as fast as it goes.
        onlooker: is given what viewers show.
        approve: asked before every grasp of an autonomous session.
    """

    operator: Operator | None = None
    guides: bool = False
    led_by: Literal["keys", "hand"] | None = None
    automatic: bool | None = None
    pace: float = 1.0
    onlooker: TrafficSink | None = None
    approve: Approve = everything_approved


def settings_for(settings: ConductorSettings, attendance: Attendance) -> ConductorSettings:
    """The session's settings, with what was asked for on the command line."""
    asked = {"led_by": attendance.led_by, "automatic": attendance.automatic}
    changes = {name: value for name, value in asked.items() if value is not None}
    guided = settings.guided.model_copy(update=changes)
    if not attendance.guides:
        return settings
    safety = settings.safety.model_copy(update={"session_limit_s": guided.session_limit_s})
    return settings.model_copy(update={"guided": guided, "safety": safety})


def crew_for(
    attendance: Attendance,
    bench: Bench,
    slam: TactileSlam,
    settings: ConductorSettings,
    session_folder: Path,
    *,
    seed: int,
    dimension: int,
) -> Crew:
    """The crew that fits who is there."""
    operator = attendance.operator
    if operator is not None and attendance.guides:
        pace = _pace(bench, attendance)
        return guided_crew(bench, slam, settings, operator, session_folder, seed=seed, dimension=dimension, pace=pace)
    crew = autonomous_crew(bench, slam, settings, seed=seed, dimension=dimension, approve=attendance.approve)
    if operator is None:
        return crew
    pace = _pace(bench, attendance)
    decisions = AttendedDecisions(
        crew.thinking, recorded_by(bench), attendance.approve, operator, crew.guard, lambda: pace(bench.clock.now_ns())
    )
    return replace(crew, decisions=decisions)


def _pace(bench: Bench, attendance: Attendance) -> Callable[[int], None]:
    if attendance.pace > 0.0 and isinstance(bench.clock, VirtualClock):
        return Pace(MonotonicClock(), attendance.pace)
    return lambda stamp_ns: None
