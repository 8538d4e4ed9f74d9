"""Policies over the hand's own candidates without physics: a session takes seconds, so that many can be compared.

Planner, candidates, policies, estimation and monitor are those of a session on the simulated rig
(:mod:`tactile_lab.experiments.runs.hand_exploration`); the grasps are done by
:class:`tactile_lab.experiments.data.kinematic_hand.KinematicHand`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from drivers.core.contacts import StepSigma
from drivers.shadow.closing.posture import HandShape
from sessions.conductor.decisions import DoGrasp, Veto
from sessions.conductor.estimator_client import LocalClient
from tactile_lab.autonomy.autonomous_roles import planner_for
from tactile_lab.autonomy.planner import Planner
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.autonomy.slam_service import SlamService
from tactile_lab.experiments.cells import Cell, Setting, grid
from tactile_lab.experiments.data.kinematic_hand import FELT, KinematicHand
from tactile_lab.experiments.data.solids import solid
from tactile_lab.experiments.runs.coverage_monitor import CoverageMonitor, UntilExplored
from tactile_lab.experiments.runs.hand_exploration import OBJECTS, RIG, conductor_settings, estimation
from tactile_lab.rigs.build import force_tips
from tactile_lab.rigs.description import load_rig
from tactile_lab.slam.tactile_slam import TactileSlam

POLICIES = ("random", "clusters", "information")
PALM, TOUCH = "palm", "touch"
"""What tells how a carried object moved."""


def settings(actions: int) -> list[Setting]:
    """Every object with each of these policies, in the plane and in space, with a budget of actions."""
    return grid(object=list(OBJECTS), dimension=[2, 3], policy=list(POLICIES), actions=[actions])


def felt_settings(actions: int) -> list[Setting]:
    """The same with and without odometry in the hand."""
    objects, policies = list(OBJECTS), ["random", "information"]
    return grid(object=objects, dimension=[2, 3], policy=policies, actions=[actions], odometry=[PALM, TOUCH])


def explore_by_kinematics(cell: Cell) -> dict[str, Any]:
    """One session. Cell: object, dimension, policy, actions."""
    return _explore(cell, None)


def explore_felt(cell: Cell) -> dict[str, Any]:
    """The same. Cell: object, dimension, policy, actions, odometry."""
    return _explore(cell, FELT if cell["odometry"] == TOUCH else None)


def _explore(cell: Cell, felt: StepSigma | None) -> dict[str, Any]:
    rig, dimension, body = load_rig(RIG), int(cell["dimension"]), solid(cell["object"])
    slam, settings = estimation(rig, cell), conductor_settings(rig, cell)
    calibration = next(iter(force_tips(rig).values()))
    shape = HandShape(calibration.semi_axes_m, calibration.centre_distal_m)
    planner = planner_for(slam, settings, shape, cell.seed, dimension)
    monitor = CoverageMonitor(body.mesh, slam, planner.known_shape, dimension, int(cell["actions"]))
    decisions = UntilExplored(LocalClient(SlamService(slam, planner)), monitor)
    rng = np.random.default_rng([cell.seed, 52183])
    hand = KinematicHand(body, settings.cycle, shape, settings.plan.yaw_window_rad, rng, felt)
    ending = _session(hand, decisions, planner, slam, monitor, settings)
    return {**monitor.figures(slam.finish()), "status": monitor.status(ending)}


def _session(
    hand: KinematicHand,
    decisions: UntilExplored,
    planner: Planner,
    slam: TactileSlam,
    monitor: CoverageMonitor,
    settings: SessionSettings,
) -> str:
    """Grasp until the decisions end the session, or its limits say that the object is lost; returns how it ended."""
    missed = empty = 0
    while True:
        index = len(monitor.grasps)
        decisions.prepare(index)
        decision = decisions.decide(index)
        if not isinstance(decision, DoGrasp):
            return "complete"
        attempt = hand.attempt(decision.plan)
        decisions.on_arrival(attempt.landings_world_m)
        if attempt.grasp is None:
            if (missed := missed + 1) >= settings.missed_approaches:
                return "object lost"
            continue
        monitor.truth.append(hand.world_T_body)
        wanted = decisions.on_capture(attempt.grasp, attempt.plan)
        assert not isinstance(wanted, Veto)
        decisions.on_carry(hand.carry(wanted, attempt))
        step = slam.add_grasp(attempt.grasp)
        planner.on_estimate(step.index, step.verdict != "untracked")
        decisions.on_estimate(step)
        monitor.look(hand.elapsed_s / 60)
        missed, empty = 0, 0 if attempt.grasp.touching else empty + 1
        if empty >= settings.safety.empty_grasps or _has_strayed(decisions, settings):
            return "object lost"


def _has_strayed(decisions: UntilExplored, settings: SessionSettings) -> bool:
    away_m = decisions.centre_m - np.array(settings.safety.workspace_centre_m)
    return float(np.linalg.norm(away_m)) > settings.safety.object_radius_m
