"""Experiments on the laboratory's foundations: camera, pose graph, calibration, recording."""

from __future__ import annotations

from calibration.fingertip.model import PARTS
from tactile_lab.experiments.cells import grid
from tactile_lab.experiments.experiment import Experiment
from tactile_lab.experiments.groups import Column
from tactile_lab.experiments.runs import (
    calibration_runs,
    camera_runs,
    crash_runs,
    fingertip_runs,
    forearm_on_rig,
    graph_runs,
)
from tactile_lab.experiments.runs.graph_stress import stock_solvers
from tactile_lab.experiments.studies.plots import ranges

CAMERA_TRUTH = Experiment(
    "camera-truth",
    "The marker camera at 640 x 480 under ten conditions: error of the true pose, flips taken for valid.",
    lambda grasps: grid(condition=list(camera_runs.CONDITIONS)),
    camera_runs.see_object,
    (
        Column("position, mm: median / p95", "position_mm", 2, kind="pooled"),
        Column("angle, °: median / p95", "angle_deg", 3, kind="pooled"),
        Column("frames", "frames", 0, kind="sum"),
        Column("refused", "refused", 0, kind="sum"),
        Column("flips", "flips", 0, kind="sum"),
        Column("free: valid", "free_valid", 0, kind="sum"),
        Column("free: flips among them", "free_flips", 0, kind="sum"),
    ),
    ranges("condition", "largest position error, mm", "worst_mm", lambda cell: "640 x 480 pixels", columns=1),
    pooled=("condition",),
)

GRAPH_STRESS = Experiment(
    "graph-stress",
    "Pose graphs of 50 grasps with 20 % wrong loops: gtsam's solvers, ours, and an oracle that knows the right ones.",
    lambda grasps: grid(solver=[*stock_solvers(), graph_runs.OUR_SOLVER]),
    graph_runs.solve_stressed_graph,
    (
        Column("position, mm", "error_mm"),
        Column("rotation, °", "error_deg"),
        Column("time, ms", "ms", 0),
        Column("wrong loops", "wrong_loops", 0, kind="sum"),
        Column("of them accepted", "wrong_accepted", 0, kind="sum"),
        Column("right ones refused", "right_refused", 0, kind="sum"),
    ),
    ranges("solver", "position error, mm", "error_mm", lambda cell: "50 grasps, 20 % wrong loops", columns=1),
)

CALIBRATE_FOREARM = Experiment(
    "calibrate-forearm",
    "Forearm to world by touch and by a board on the palm: joint bias 0.6°, contacts 1 mm, corners 0.05 px.",
    lambda grasps: (
        grid(method=[calibration_runs.TOUCH], poses=[20, 40]) + grid(method=[calibration_runs.MARKER], poses=[10, 20])
    ),
    calibration_runs.calibrate_forearm,
    (
        Column("position, mm: median / p95", "errors_mm", 2, kind="pooled"),
        Column("rotation, °: median / p95", "errors_deg", 2, kind="pooled"),
        Column("inside the 95 % region", "inside", 1, kind="percent"),
        Column("noise found, of that stated", "noise", 2, kind="median"),
    ),
    ranges("method", "position error, mm", "error_mm", lambda cell: f"{cell['poses']} poses"),
)

FOREARM_ON_RIG = Experiment(
    "forearm-on-rig",
    "The forearm's wizard on the simulated rig, physics and all: every joint off by 0.6°, contacts by a further 1 mm.",
    lambda grasps: (
        grid(method=[calibration_runs.TOUCH], poses=[40]) + grid(method=[calibration_runs.MARKER], poses=[10, 20])
    ),
    forearm_on_rig.calibrate_on_rig,
    (
        Column("position, mm: median / p95", "errors_mm", 2, kind="pooled"),
        Column("rotation, °: median / p95", "errors_deg", 2, kind="pooled"),
        Column("stated, mm", "stated_mm", 2, kind="median"),
        Column("stated, °", "stated_deg", 2, kind="median"),
        Column("inside the 95 % region", "inside", 0, kind="percent"),
        Column("PASS", "passed", 0, kind="percent"),
        Column("noise found, of that stated", "noise", 2, kind="median"),
        Column("steps left out", "left_out", 0, kind="sum"),
        Column("contacts as felt, mm", "felt_errors_mm", 2, kind="pooled"),
        Column("°", "felt_errors_deg", 2, kind="pooled"),
        Column("inside", "felt_inside", 0, kind="percent"),
    ),
    ranges("method", "position error, mm", "error_mm", lambda cell: f"{cell['poses']} poses"),
)

CALIBRATE_FINGERTIP = Experiment(
    "calibrate-fingertip",
    "A force fingertip from its wrenches: any mounting, 4 to 20 g, joint bias 0.6°, a Nano17's drift, sliding presses.",
    lambda grasps: grid(presses=[6, 10, 20]),
    fingertip_runs.calibrate_fingertip,
    (
        Column("mounting, °: median / p95", "mounting_deg", 2, kind="pooled"),
        Column("mass, g", "mass_g", 2, kind="pooled"),
        Column("centre of mass, mm", "com_mm", 2, kind="pooled"),
        Column("ellipsoid's centre, mm", "centre_mm", 2, kind="pooled"),
        Column("semi-axes, mm", "axes_mm", 2, kind="pooled"),
        Column("inside the 95 % region", "inside", 1, kind="percent"),
        *(Column(f"inside, {part.replace('_', '-')} alone", f"inside_{part}", 1, kind="percent") for part in PARTS),
        Column("noise found, of that stated", "noise", 2, kind="median"),
    ),
    ranges("presses", "error of the mounting, °", "error_deg", lambda cell: "8 orientations and presses", columns=1),
)

CRASH_RECOVERY = Experiment(
    "crash-recovery",
    "Crashes of a recording at full load, at random instants: what is lost.",
    lambda grasps: grid(fault=crash_runs.faults_here()),
    crash_runs.crash_and_recover,
    (
        Column("messages recovered", "recovered", 0),
        Column("messages lost", "lost", 0),
        Column("lost before the end, ms", "lost_ms", 0),
        Column("of the hand, ms", "hand_ms", 0),
        Column("of force sensors, ms", "ft_ms", 0),
        Column("of pictures, ms", "camera_ms", 0),
        Column("longest write, ms", "write_ms", 1),
        Column("late messages", "late", 0, kind="median"),
    ),
    ranges("fault", "lost at the end, ms", "lost_ms", lambda cell: "full load", columns=1),
    left_out=crash_runs.needs_root,
)
