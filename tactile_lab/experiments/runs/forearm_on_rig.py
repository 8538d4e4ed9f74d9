"""The wizard's calibration of the forearm on the simulated rig with its physics, compared with the rig's truth.

Plan, measurer, motion check, solution and verdict are the wizard's own, as with ``calibrate forearm --rig sim
--no-input``. Only the rig is worse than the packaged one: its mount is not where its file says, and the wrist's joints
have the same bias as the fingers'.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from gtsam import Pose3

from calibration.forearm.recordings import ForearmData
from calibration.forearm.wizard import ForearmResult, WizardSettings, solve_forearm
from calibration.steps.quality import region_holds
from drivers.core.fingertip import RigidTransform
from drivers.core.poses import rotation_angle_rad
from sessions.recording.recorder import NullTraffic
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.data.calibration_data import CONTACT_SIGMA_m, JOINT_BIAS_rad
from tactile_lab.experiments.runs.calibration_runs import TOUCH
from tactile_lab.rigs.description import Rig, load_rig
from tactile_lab.workflow.calibrating_forearm import ForearmRequest, forearm_wizard

RIG = "sim"
PLACE_m, TURN_rad = 0.005, float(np.radians(0.5))
"""Distance of the mount from its pose in the rig's file, one standard deviation per axis: as if measured by tape."""

_NOT_FELT: Mapping[str, Any] = {"errors_mm": [], "errors_deg": [], "inside": None}
_TOUCHED_FACES = 5  # in the packaged rig's geometry: the top of the table and its four edges


def calibrate_on_rig(cell: Cell) -> Mapping[str, Any]:
    """One run of the wizard. Cell: method, poses."""
    rng = np.random.default_rng((cell.seed, 1))  # random numbers independent of those for the rig and its board
    rig, method, poses = displaced_rig(rng), str(cell["method"]), int(cell["poses"])
    request = ForearmRequest(rig, method, cell.seed, touches=poses // _TOUCHED_FACES, pictures=poses)
    with forearm_wizard(request, NullTraffic()) as (wizard, measurer):
        left_out = wizard.measure_all(measurer)
        data = wizard.measured
    truth = rig.description.simulation.world_T_mount.pose()
    as_felt = _figures(data, wizard.settings, truth) if method == TOUCH else _NOT_FELT
    figures = _figures(rougher(data, rng), wizard.settings, truth)
    return {**figures, "left_out": left_out, **{f"felt_{name}": as_felt[name] for name in _NOT_FELT}}


def displaced_rig(rng: np.random.Generator) -> Rig:
    """The packaged rig with random errors of its mount and of its wrist's joints."""
    rig = load_rig(RIG)
    off = Pose3.Expmap(np.repeat([TURN_rad, PLACE_m], 3) * rng.standard_normal(6))
    (x, y, z), (roll, pitch, yaw) = off.translation().tolist(), off.rotation().xyz().tolist()
    simulation = rig.description.simulation
    changes = {
        "world_T_mount": RigidTransform(translation_m=(x, y, z), rpy_rad=(roll, pitch, yaw)),
        "joint_sensors": simulation.joint_sensors.model_copy(update={"wrist_bias_rad": JOINT_BIAS_rad}),
    }
    description = rig.description.model_copy(update={"simulation": simulation.model_copy(update=changes)})
    return replace(rig, description=description)


def rougher(data: ForearmData, rng: np.random.Generator) -> ForearmData:
    """The touches with an additional error of a millimetre per axis, because the rig's own sensors are better than
    that.
    """
    added = CONTACT_SIGMA_m**2 * np.eye(3)
    touches = tuple(
        replace(
            touch,
            point_distal_m=touch.point_distal_m + CONTACT_SIGMA_m * rng.standard_normal(3),
            point_covariance_m2=touch.point_covariance_m2 + added,
        )
        for touch in data.touches
    )
    return replace(data, touches=touches)


def _figures(data: ForearmData, settings: WizardSettings, truth: Pose3) -> dict[str, Any]:
    result = solve_forearm(data, settings)
    off = result.solution.world_T_mount.between(truth)
    error_mm, error_deg = 1e3 * float(np.linalg.norm(off.translation())), float(np.degrees(rotation_angle_rad(off)))
    return {
        "error_mm": error_mm,
        "errors_mm": [error_mm],
        "errors_deg": [error_deg],
        "inside": float(region_holds(result.solution, truth)),
        "passed": float(result.quality.passed),
        "noise": float(np.sqrt(result.solution.variance_factor)),
        **_stated_error(result),
    }


def _stated_error(result: ForearmResult) -> dict[str, float]:
    """The root mean square error that the result itself states."""
    covariance = result.solution.covariance
    return {
        "stated_mm": 1e3 * float(np.sqrt(np.trace(covariance[3:, 3:]))),
        "stated_deg": float(np.degrees(np.sqrt(np.trace(covariance[:3, :3])))),
    }
