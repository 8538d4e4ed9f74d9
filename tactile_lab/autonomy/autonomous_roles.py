"""The roles of a session without a person: the hand moves by itself, the planner decides."""

from __future__ import annotations

import numpy as np

from drivers.shadow.closing.posture import HandShape
from sessions.conductor.decisions import SessionRoles
from sessions.conductor.policy_decisions import Approve, PolicyDecisions, approve_everything, record_choices
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_cycle import GraspCycle
from sessions.motion.motion import Motion
from sessions.motion.probing.box_prober import BoxProber
from sessions.motion.probing.raking import Raker
from sessions.motion.safety import InterruptGuard, SafetySettings, SafetySupervisor
from sessions.rig_runtime.rig_runtime import RigRuntime
from tactile_lab.autonomy.closing_tables import solve_closings
from tactile_lab.autonomy.estimator_process import client_for
from tactile_lab.autonomy.hand_candidates import HandLimits
from tactile_lab.autonomy.heuristic_planner import HeuristicPlanner, PlanSettings
from tactile_lab.autonomy.planner import Planner
from tactile_lab.autonomy.policy_choice import PolicyChooser
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.autonomy.slam_service import SlamService
from tactile_lab.autonomy.standing.candidate import SideReach
from tactile_lab.autonomy.variance_planner import ExplorationSettings
from tactile_lab.slam.exploration.policies import make_policy
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.slam.tracking.contacts.motion import MotionNoise


def autonomous_roles(
    runtime: RigRuntime,
    slam: TactileSlam,
    settings: SessionSettings,
    *,
    seed: int = 0,
    dimension: int = 2,
    approve: Approve = approve_everything,
) -> SessionRoles:
    """The roles of a session without a person: the hand moves by itself, the planner decides.

    Args:
        runtime, slam, settings: of the session.
        seed: of all random numbers.
        dimension: of the estimation.
        approve: asked before every grasp; may veto it.

    Raises:
        ConfigurationError: the policy in the settings does not exist.
    """
    supervisor = SafetySupervisor(runtime, settings.safety, runtime.cycle_ns)
    hand, window = hand_shape(runtime), settings.plan.yaw_window_rad
    solve_closings(runtime.clock, settings, hand, dimension)
    motion = Motion(runtime, supervisor)
    cycle = GraspCycle(motion, settings.cycle, hand, window)
    planner = planner_for(slam, settings, hand, seed, dimension)
    client = client_for(runtime.clock, SlamService(slam, planner), cycle.idle)
    guard = InterruptGuard()
    decisions = PolicyDecisions(client, record_choices(runtime), approve, guard)
    if not settings.probing.is_wanted:
        return SessionRoles(supervisor, cycle, decisions, client, cycle.weigh, cycle.forecast, guard=guard)
    prober = prober_for(motion, settings, hand)
    felt = prober.feel, prober.find_again
    return SessionRoles(supervisor, cycle, decisions, client, cycle.weigh, cycle.forecast, *felt, guard)


def prober_for(motion: Motion, settings: SessionSettings, hand: HandShape) -> BoxProber:
    """Measures the bounding box of a session's object."""
    toucher, plan = Raker(motion, settings.cycle, hand), settings.plan
    return BoxProber(toucher, settings.probing, plan.yaw_window_rad, plan.start_m)


def planner_for(slam: TactileSlam, settings: SessionSettings, hand: HandShape, seed: int, dimension: int) -> Planner:
    """The planner of a session, with the policy of its settings.

    Raises:
        ConfigurationError: there is no such policy.
    """
    rule = HeuristicPlanner(settings.plan, np.random.default_rng(seed), dimension)
    chooser = None
    if policy := settings.exploration.policy:
        limits = settings.plan, settings.exploration, settings.cycle, settings.safety
        chooser = chooser_for(policy, limits, hand, dimension, slam.settings.motion, seed)
    return Planner(
        slam,
        rule,
        settings.exploration,
        settings.fixed_grasps,
        hand,
        dimension,
        chooser,
        settings.grasps,
        side_reach(settings),
        settings.cycle.touch,
    )


def side_reach(settings: SessionSettings) -> SideReach:
    """Where the palm may be beside an object."""
    safety = settings.safety
    cycle = settings.cycle
    return SideReach(safety.workspace_radius_m, safety.workspace_centre_m, cycle.standoff_m, cycle.touch.row_m)


def hand_shape(runtime: RigRuntime) -> HandShape:
    """The hand of a rig: its form, and its fingertips' shape by calibration; the default one if the rig has none."""
    form = runtime.perception.form
    for calibration in runtime.fingertip_calibrations.values():
        return HandShape(calibration.semi_axes_m, calibration.centre_distal_m, form)
    return HandShape(form=form)


def chooser_for(
    policy: str,
    settings: tuple[PlanSettings, ExplorationSettings, CycleSettings, SafetySettings],
    hand: HandShape,
    dimension: int,
    noise: MotionNoise,
    seed: int,
) -> PolicyChooser:
    """The policy named ``policy`` with the hand's candidates. Raises ConfigurationError if there is none."""
    plan, exploration, cycle, safety = settings
    limits = HandLimits(plan, exploration, cycle, safety, hand, dimension)
    return PolicyChooser(make_policy(policy, exploration.information), limits, noise, np.random.default_rng([seed, 1]))
