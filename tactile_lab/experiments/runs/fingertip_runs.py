"""Calibrations of a force fingertip from simulated wrenches: their errors, and whether confidence regions contain the
truth.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from gtsam import Pose3, Rot3

from calibration.fingertip.data import FingertipData, WrenchPose, wrench_pose
from calibration.fingertip.fit import FingertipFit, fit_fingertip
from calibration.fingertip.model import PARTS, lowest
from calibration.fingertip.plan import PlannedFree, PlannedWrench, plan_wrenches
from calibration.forearm.touch_plan import pointing_vector
from calibration.steps.hand_chain import WRIST, mount_T_link
from calibration.steps.observations import HandPose
from drivers.core.contacts import Array
from drivers.core.fingertip import GRAVITY, FingertipCalibration, RigidTransform
from drivers.shadow.closing.posture import TipEllipsoid
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINTS
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.data.calibration_data import JOINT_BIAS_rad

FINGER: Literal["FF"] = "FF"
NOMINAL = FingertipCalibration(
    semi_axes_m=(0.0085, 0.0085, 0.013),
    centre_distal_m=(0.0, 0.0, 0.019),
    distal_T_sensor=RigidTransform(translation_m=(0.0, 0.0, 0.004)),
    mass_kg=0.008,
    com_distal_m=(0.0, 0.0, 0.019),
)

MASSES_kg = (0.004, 0.02)
SHAPE_m, ASKEW_rad = 1e-3, float(np.radians(4.0))
PRESSES_N, SLIDING_rad = (0.5, 1.1), (0.15, 0.4)
STEP_s, PRESS_s, DRIFT_s, SAMPLES = 4.0, 2.5, 20.0, 40
CONTACT_m = 1e-4


def calibrate_fingertip(cell: Cell) -> Mapping[str, Any]:
    """Draw a fingertip and its wrenches, fit, and compare with the truth.

    The sensor is mounted at any angle about the finger and slightly askew; masses are 4 to 20 g; the ellipsoid is off
    by 1 mm per coordinate, and every joint of the finger by 0.6 degrees; friction tilts forces by 9 to 23 degrees from
    the plate's normal; readings drift like those of a Nano17, by 10 mN and 0.05 N mm.
    """
    rng = np.random.default_rng(cell.seed)
    truth = draw(rng)
    found = fit_fingertip(recording(truth, rng, int(cell["presses"])), NOMINAL)
    return {**_errors(found, truth), "noise": float(np.sqrt(found.variance_factor))}


def draw(rng: np.random.Generator) -> FingertipCalibration:
    """Draw a fingertip that differs from its nominal parameters."""
    lean, turn = ASKEW_rad * rng.standard_normal(2), float(rng.uniform(-np.pi, np.pi))
    shape = np.array([*NOMINAL.centre_distal_m, *NOMINAL.semi_axes_m]) + SHAPE_m * rng.standard_normal(6)
    com = np.array(NOMINAL.com_distal_m) + 2e-3 * rng.standard_normal(3)
    mounting = RigidTransform(
        translation_m=NOMINAL.distal_T_sensor.translation_m, rpy_rad=(float(lean[0]), float(lean[1]), turn)
    )
    changes = {
        "distal_T_sensor": mounting,
        "mass_kg": float(rng.uniform(*MASSES_kg)),
        "com_distal_m": tuple(com.tolist()),
        "centre_distal_m": tuple(shape[:3].tolist()),
        "semi_axes_m": tuple(shape[3:].tolist()),
    }
    return NOMINAL.model_copy(update=changes)


def recording(truth: FingertipCalibration, rng: np.random.Generator, presses: int = 10) -> FingertipData:
    """A fingertip's recording as the measurer would make it: every planned step, and each press with the moment before
    it.
    """
    bias_rad = JOINT_BIAS_rad * rng.standard_normal(len(JOINTS))
    bias_rad[[JOINT_INDEX[joint] for joint in WRIST]] = 0.0  # the forearm's calibration has absorbed it
    free, pressed, times = [], [], []
    for index, planned in enumerate(plan_wrenches(FINGER, presses)):
        turned = _orientations(planned, bias_rad)
        times.append(STEP_s * index)
        free.append((turned[1], _wrench(truth, turned[0], None, rng)))
        if not isinstance(planned, PlannedFree):
            times.append(STEP_s * index + PRESS_s)
            pressed.append((turned[1], _wrench(truth, turned[0], _force(turned[0][2], rng), rng)))
    errors = dict(zip(times, _reading_errors(truth, np.array(times), rng), strict=True))
    calm = [STEP_s * index for index in range(len(free))]
    hard = [time for time in times if time not in calm]
    return FingertipData(
        rig="simulated", finger=FINGER, free=_poses(free, calm, errors), presses=_poses(pressed, hard, errors)
    )


def _poses(
    taken: list[tuple[Array, Array]], times: list[float], errors: Mapping[float, Array]
) -> tuple[WrenchPose, ...]:
    return tuple(
        wrench_pose(rotation, wrench + errors[time], time)
        for (rotation, wrench), time in zip(taken, times, strict=True)
    )


def _orientations(planned: PlannedWrench, bias_rad: Array) -> tuple[Array, Array]:
    """The true and the measured orientation of the distal frame in the world, shape (3, 3) each."""
    joints = pointing_vector(FINGER)
    if isinstance(planned, PlannedFree):
        base_q = planned.base_q(Pose3(), joints)
    else:
        base_q = planned.base_q(Pose3(), joints, TipEllipsoid())
    poses = (HandPose(base_q, joints), HandPose(base_q, joints + bias_rad))
    true, measured = (mount_T_link(pose, FINGER)[:3, :3] for pose in poses)
    return true, measured


def _force(up: Array, rng: np.random.Generator) -> Array:
    """The force of a press, distal frame, tilted from the plate's normal by friction in a random direction."""
    sideways = np.cross(up, rng.standard_normal(3))
    turn = Rot3.Expmap(rng.uniform(*SLIDING_rad) * sideways / np.linalg.norm(sideways))
    return np.asarray(rng.uniform(*PRESSES_N) * turn.matrix() @ up)


def _wrench(
    truth: FingertipCalibration, world_R_distal: Array, press_N: Array | None, rng: np.random.Generator
) -> Array:
    """The load on the sensor, sensor frame, shape (6,)."""
    mounting, up = truth.distal_T_sensor.pose(), world_R_distal[2]
    place, rotation = np.asarray(mounting.translation()), mounting.rotation().matrix()
    weight = -truth.mass_kg * GRAVITY * up
    force, torque = weight, np.cross(np.array(truth.com_distal_m) - place, weight)
    if press_N is not None:
        shape = np.array([*truth.centre_distal_m, *truth.semi_axes_m])
        point = lowest(shape, up[None])[0] + CONTACT_m * rng.standard_normal(3)
        force, torque = force + press_N, torque + np.cross(point - place, press_N)
    return np.concatenate([force @ rotation, torque @ rotation])


def _reading_errors(tip: FingertipCalibration, times_s: Array, rng: np.random.Generator) -> Array:
    """Bias, drift and noise of each mean reading, shape (n, 6)."""
    drift = np.repeat([tip.force_drift_N, tip.moment_drift_Nm], 3)
    noise = np.repeat([tip.force_sigma_N, tip.moment_sigma_Nm], 3) / np.sqrt(SAMPLES)
    root = np.linalg.cholesky(np.exp(-np.abs(times_s[:, None] - times_s) / DRIFT_s))
    bias = np.repeat([0.3, 2e-3], 3) * rng.standard_normal(6)
    fresh = rng.standard_normal((2, len(times_s), 6))
    return np.asarray(bias + drift * (root @ fresh[0]) + noise * fresh[1])


def _errors(found: FingertipFit, truth: FingertipCalibration) -> dict[str, Any]:
    sizes = {part: float(np.linalg.norm(found.errors(truth)[rows])) for part, rows in PARTS.items()}
    return {
        "mounting_deg": [float(np.degrees(sizes["mounting"]))],
        "mass_g": [1e3 * sizes["mass"]],
        "com_mm": [1e3 * sizes["com"]],
        "centre_mm": [1e3 * sizes["centre"]],
        "axes_mm": [1e3 * sizes["semi_axes"]],
        "error_deg": float(np.degrees(sizes["mounting"])),
        "inside": float(found.holds(truth)),
        **{f"inside_{part}": float(found.holds(truth, part)) for part in PARTS},
    }
