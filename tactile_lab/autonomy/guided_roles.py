"""The roles of a guided session: the same conductor, a person decides."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from sessions.conductor.decisions import Performer, SessionRoles
from sessions.guided.by_hand import GraspByHand
from sessions.guided.by_keys import GraspByKeys
from sessions.guided.console import OperatorConsole
from sessions.guided.decisions import GuidedDecisions
from sessions.guided.motion import GuidedMotion
from sessions.guided.operator import Operator
from sessions.guided.survey import SurveyOnRequest
from sessions.motion.safety import InterruptGuard, SafetySupervisor
from sessions.recording.attachments import Attachments
from sessions.rig_runtime.rig_runtime import RigRuntime
from tactile_lab.autonomy.autonomous_roles import hand_shape, prober_for, side_reach
from tactile_lab.autonomy.closing_tables import solve_closings
from tactile_lab.autonomy.estimator_process import client_for
from tactile_lab.autonomy.heuristic_planner import HeuristicPlanner
from tactile_lab.autonomy.planner import Planner
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.autonomy.slam_service import SlamService
from tactile_lab.slam.tactile_slam import TactileSlam


def guided_roles(
    runtime: RigRuntime,
    slam: TactileSlam,
    settings: SessionSettings,
    operator: Operator,
    session_folder: Path,
    *,
    seed: int = 0,
    dimension: int = 2,
    pace: Callable[[int], None] = lambda stamp_ns: None,
) -> SessionRoles:
    """The roles of a guided session.

    Args:
        runtime: connected.
        slam: the estimation.
        settings: of the session.
        operator: the person.
        session_folder: folder for notes and pictures.
        seed: of the suggestions.
        dimension: of the estimation, 2 or 3.
        pace: see :class:`OperatorConsole`.
    """
    supervisor, guard = SafetySupervisor(runtime, settings.safety, runtime.cycle_ns), InterruptGuard()
    hand, cycle, guided = hand_shape(runtime), settings.cycle, settings.guided
    solve_closings(runtime.clock, settings, hand, dimension)
    console = OperatorConsole(runtime, operator, guided, Attachments(session_folder), cycle.touch_force_N, guard, pace)
    motion = GuidedMotion(runtime, supervisor, console)
    performer: Performer = (
        GraspByHand(motion, cycle, console, hand)
        if guided.led_by == "hand"
        else GraspByKeys(motion, cycle, console, hand, settings.plan.yaw_window_rad)
    )
    rule = HeuristicPlanner(settings.plan, np.random.default_rng(seed), dimension)
    reach = side_reach(settings)
    planner = Planner(slam, rule, settings.exploration, settings.fixed_grasps, hand, dimension, reach=reach)
    client = client_for(runtime.clock, SlamService(slam, planner), performer.idle)
    if guided.led_by == "hand" or not settings.probing.is_wanted:
        return SessionRoles(supervisor, performer, GuidedDecisions(client, console), client, guard=guard)
    prober = prober_for(motion, settings, hand)
    survey = SurveyOnRequest(prober, motion, console).feel
    decisions = GuidedDecisions(client, console, felt=True)
    return SessionRoles(supervisor, performer, decisions, client, survey=survey, find=prober.find_again, guard=guard)
