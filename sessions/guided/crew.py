"""The crew of a guided session: the same conductor, a person decides."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from sessions.attachments import Attachments
from sessions.autonomous_crew import tip_shape
from sessions.bench import Bench
from sessions.closing_tables import solve_closings
from sessions.conductor_settings import ConductorSettings
from sessions.decisions import Crew, Performer
from sessions.guided.by_hand import GraspByHand
from sessions.guided.by_keys import GraspByKeys
from sessions.guided.decisions import GuidedDecisions
from sessions.guided.desk import Desk
from sessions.guided.motion import GuidedMotion
from sessions.guided.operator import Operator
from sessions.next_grasp import FixedRule
from sessions.planner import Planner
from sessions.safety import InterruptGuard, SafetySupervisor
from sessions.thinker import Thinker
from sessions.thinker_process import thinking_for
from tactile_lab.slam import TactileSlam


def guided_crew(
    bench: Bench,
    slam: TactileSlam,
    settings: ConductorSettings,
    operator: Operator,
    session_folder: Path,
    *,
    seed: int = 0,
    dimension: int = 2,
    pace: Callable[[int], None] = lambda stamp_ns: None,
) -> Crew:
    """The crew of a guided session.

    Args:
        bench: connected.
        slam: the estimation.
        settings: of the session.
        operator: the person.
        session_folder: where notes and pictures go.
        seed: of the suggestions.
        dimension: the estimation's, 2 or 3.
        pace: see :class:`Desk`.
    """
    supervisor, guard = SafetySupervisor(bench, settings.safety, bench.cycle_ns), InterruptGuard()
    tip, cycle, guided = tip_shape(bench), settings.cycle, settings.guided
    solve_closings(bench.clock, settings, tip, dimension)
    desk = Desk(bench, operator, guided, Attachments(session_folder), cycle.touch_force_N, guard, pace)
    motion = GuidedMotion(bench, supervisor, desk)
    performer: Performer = (
        GraspByHand(motion, cycle, desk, tip)
        if guided.led_by == "hand"
        else GraspByKeys(motion, cycle, desk, tip, settings.plan.yaw_window_rad)
    )
    rule = FixedRule(settings.plan, np.random.default_rng(seed), dimension)
    planner = Planner(slam, rule, settings.exploration, settings.fixed_grasps, tip, dimension)
    thinking = thinking_for(bench.clock, Thinker(slam, planner), performer.idle)
    return Crew(supervisor, performer, GuidedDecisions(thinking, desk), thinking, guard=guard)
