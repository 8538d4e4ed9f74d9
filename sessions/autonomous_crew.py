"""The crew of a session without a person: the hand moves by itself, the planner decides."""

from __future__ import annotations

import numpy as np

from drivers.shadow.posture import TipEllipsoid
from sessions.bench import Bench
from sessions.bounding_box import BoxProber
from sessions.closing_tables import solve_closings
from sessions.conductor_settings import ConductorSettings
from sessions.decisions import Crew
from sessions.grasp_cycle import GraspCycle
from sessions.motion import Motion
from sessions.next_grasp import FixedRule
from sessions.planner import Planner
from sessions.policy_decisions import Approve, PolicyDecisions, chooser_for, everything_approved, recorded_by
from sessions.safety import InterruptGuard, SafetySupervisor
from sessions.thinker import Thinker
from sessions.thinker_process import thinking_for
from sessions.touching import Toucher
from tactile_lab.slam import TactileSlam


def autonomous_crew(
    bench: Bench,
    slam: TactileSlam,
    settings: ConductorSettings,
    *,
    seed: int = 0,
    dimension: int = 2,
    approve: Approve = everything_approved,
) -> Crew:
    """The crew of a session without a person: the hand moves by itself, the planner decides.

    Args:
        bench, slam, settings: of the session.
        seed: of what is left to chance.
        dimension: of the estimation.
        approve: asked before every grasp; refuses what a person does not want.

    Raises:
        ConfigurationError: there is no policy of the name in the settings.
    """
    supervisor = SafetySupervisor(bench, settings.safety, bench.cycle_ns)
    tip, window = tip_shape(bench), settings.plan.yaw_window_rad
    solve_closings(bench.clock, settings, tip, dimension)
    motion = Motion(bench, supervisor)
    cycle = GraspCycle(motion, settings.cycle, tip, window)
    planner = planner_for(slam, settings, tip, seed, dimension)
    thinking = thinking_for(bench.clock, Thinker(slam, planner), cycle.idle)
    guard = InterruptGuard()
    decisions = PolicyDecisions(thinking, recorded_by(bench), approve, guard)
    if not settings.probing.enabled:
        return Crew(supervisor, cycle, decisions, thinking, guard=guard)
    prober = BoxProber(Toucher(motion, settings.cycle, tip), settings.probing, window, settings.plan.start_m)
    return Crew(supervisor, cycle, decisions, thinking, prober.feel, guard)


def planner_for(
    slam: TactileSlam, settings: ConductorSettings, tip: TipEllipsoid, seed: int, dimension: int
) -> Planner:
    """What chooses the grasps of a session, with the policy of its settings.

    Raises:
        ConfigurationError: there is no policy of that name.
    """
    rule = FixedRule(settings.plan, np.random.default_rng(seed), dimension)
    chooser = None
    if policy := settings.exploration.policy:
        limits = settings.plan, settings.exploration, settings.cycle, settings.safety
        chooser = chooser_for(policy, limits, tip, dimension, slam.settings.motion, seed)
    return Planner(slam, rule, settings.exploration, settings.fixed_grasps, tip, dimension, chooser, settings.grasps)


def tip_shape(bench: Bench) -> TipEllipsoid:
    """The fingertip's shape by calibration; the default one where a rig has none."""
    for calibration in bench.fingertip_calibrations.values():
        return TipEllipsoid(calibration.semi_axes_m, calibration.centre_distal_m)
    return TipEllipsoid()
