"""One calibration of the forearm from simulated data: its error, and whether its confidence region contains the
truth.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from calibration.forearm.board_problem import BoardProblem
from calibration.forearm.touch_plan import plan_touches
from calibration.forearm.touch_problem import TouchProblem
from calibration.forearm.view_plan import ViewSettings, plan_views
from calibration.steps.geometry import KnownGeometry, TableEdges
from calibration.steps.quality import Problem, region_holds
from drivers.core.poses import rotation_angle_rad
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.data.calibration_data import CAMERA, MARKERS, TrueRig, touches_of, views_of

TOUCH, MARKER = "touch", "marker"
FINGERS = ("FF", "MF")
GEOMETRY = KnownGeometry(table=TableEdges(size_m=(1.0, 1.0), thickness_m=0.02, pressed_m=0.3))


def calibrate_forearm(cell: Cell) -> Mapping[str, Any]:
    """Draw a rig and its data, solve, and compare with the truth.

    Standard deviations: bias of every joint, including the wrist, 0.6 degrees; contacts 1 mm per axis; corners 0.05
    pixels. The world marker's four corners have a further common error of 0.03 pixels in all pictures; the size of
    prints is off by 0.03 %.
    """
    rng = np.random.default_rng(cell.seed)
    rig = TrueRig.draw(rng)
    problem = _problem(cell["method"], int(cell["poses"]), rig, rng)
    solution = problem.solve()
    off = solution.world_T_mount.between(rig.world_T_mount)
    error_mm, error_deg = 1e3 * float(np.linalg.norm(off.translation())), float(np.degrees(rotation_angle_rad(off)))
    return {
        "error_mm": error_mm,
        "errors_mm": [error_mm],
        "errors_deg": [error_deg],
        "inside": float(region_holds(solution, rig.world_T_mount)),
        "noise": float(np.sqrt(solution.variance_factor)),
    }


def _problem(method: str, poses: int, rig: TrueRig, rng: np.random.Generator) -> Problem:
    if method == TOUCH:
        plan = plan_touches(GEOMETRY, FINGERS, poses // 5)
        return TouchProblem(touches_of(plan, rig, rng))
    views = views_of(plan_views(ViewSettings(pictures=poses)), rig, rng)
    return BoardProblem(views, CAMERA, MARKERS)
