"""Estimates a force fingertip's mounting, weight and shape from wrenches in known orientations.

* Untouched, with the hand turned: the weight gives mass, centre of mass and bias.
* Pressed on a level plate: the force points about up, which gives the sign of the readings and, roughly, the sensor's
  mounting angle; roughly, because of friction.
* Pressed and rolled on a plate: the torque gives the point of the force, and so mounting and ellipsoid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gtsam import Rot3
from scipy.stats import chi2

from calibration.fingertip.data import FingertipData
from calibration.fingertip.model import PARTS, FingertipNoise, Part, Refined, refine, ups, wrenches
from calibration.forearm.hand_eye import nearest_rotation
from calibration.steps.motion_check import Check, MotionReport
from calibration.steps.quality import CONFIDENCE
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.core.fingertip import FingertipCalibration, RigidTransform

LEAST_ORIENTATIONS, LEAST_PRESSES = 6, 6
LEAST_SPREAD = 0.05
"""Smallest mean squared share of directions along any axis: below it orientations in some direction are missing."""

PRESS_N = 0.3
LARGEST_TILT_rad = float(np.radians(40.0))
"""Largest angle of the forces from the plate's normal: friction and the yielding finger allow some."""


@dataclass(frozen=True, eq=False)
class FingertipFit:
    """The result.

    Attributes:
        calibration: the new one.
        turned_rad: by how much the mounting differs from the one before.
        covariance: of what was found, shape (13, 13), in the order of :data:`calibration.fingertip.model.PARTS`.
        variance_factor: squared residuals over what the stated noise allows.
        rms_force_N: residual of the untouched forces, per axis.
        rms_lever_m: residual of the presses' torques, per newton and axis.
        tilt_rad: root mean square angle between the presses' forces and the plate's normal.
    """

    calibration: FingertipCalibration
    turned_rad: float
    covariance: Array
    variance_factor: float
    rms_force_N: float
    rms_lever_m: float
    tilt_rad: float

    def sigma(self, part: Part) -> float:
        """Standard deviation of a part's length: kg, radians or metres."""
        rows = PARTS[part]
        return float(np.sqrt(np.trace(self.covariance[rows, rows])))

    def errors(self, truth: FingertipCalibration) -> Array:
        """Error of the result relative to the truth, in the order of the covariance, shape (13,)."""
        found = self.calibration
        turn = found.distal_T_sensor.pose().rotation().between(truth.distal_T_sensor.pose().rotation())
        back = found.distal_T_sensor.pose().rotation().matrix() @ Rot3.Logmap(turn)
        pairs = (
            ((truth.mass_kg,), (found.mass_kg,)),
            (truth.com_distal_m, found.com_distal_m),
            (truth.centre_distal_m, found.centre_distal_m),
            (truth.semi_axes_m, found.semi_axes_m),
        )
        return np.concatenate([-back, *(np.subtract(true, mine) for true, mine in pairs)])

    def holds(self, truth: FingertipCalibration, part: Part | None = None) -> bool:
        """Whether the 95 % region of a part, or of everything together, contains the truth."""
        rows = slice(None) if part is None else PARTS[part]
        off, spread = self.errors(truth)[rows], self.covariance[rows, rows]
        return bool(off @ np.linalg.solve(spread, off) <= chi2.ppf(CONFIDENCE, len(off)))


def fit_fingertip(
    data: FingertipData, before: FingertipCalibration, noise: FingertipNoise | None = None
) -> FingertipFit:
    """A rough mounting from the directions of the forces, then everything together.

    Raises:
        ConfigurationError: too few or too similar orientations, soft presses, readings of the opposite sign, or
            no weight.
    """
    where = f"fingertip {data.finger}"
    down, up = -ups(data.free), ups(data.presses)
    _check_spread(down, LEAST_ORIENTATIONS, "untouched wrenches", where)
    free, pressed = wrenches(data.free), wrenches(data.presses)
    _check_spread(up, LEAST_PRESSES, "presses", where, rank=2)
    bias = _bias(free, down)
    start = _mounting(pressed[:, :3] - bias[:3], up, free[:, :3] - bias[:3], down, where)
    found = refine(data, before, start, noise or FingertipNoise())
    if found.mass_kg <= 0.0:
        hint = "Turn the hand farther between the untouched readings, and let the sensor warm up"
        raise ConfigurationError("the untouched readings show no weight", where=where, hint=hint)
    turned = Rot3(before.distal_T_sensor.pose().rotation().matrix() @ found.sensor_R_distal)
    return FingertipFit(
        calibration=_calibration(before, found),
        turned_rad=float(np.linalg.norm(Rot3.Logmap(turned))),
        covariance=found.covariance,
        variance_factor=found.variance_factor,
        rms_force_N=_rms(found.rest[:, :3]),
        rms_lever_m=_rms(found.rest_lever_m),
        tilt_rad=_rms(_angles(found.forces_distal_N, up)),
    )


def wrench_motion(data: FingertipData) -> MotionReport:
    """Whether the orientations of the data are sufficient, and what is missing."""
    turn = "turn the hand so that the fingertip points down, level, sideways and up"
    return MotionReport(
        (
            Check("untouched wrenches", len(data.free), LEAST_ORIENTATIONS, "", "take more"),
            Check("spread of their orientations", _spread(ups(data.free), 3), LEAST_SPREAD, "of 0.33", turn),
            Check("presses", len(data.presses), LEAST_PRESSES, "", "press more"),
            Check("spread of their orientations", _spread(ups(data.presses), 2), LEAST_SPREAD, "of 0.5", "roll more"),
        )
    )


def _spread(directions: Array, rank: int) -> float:
    """Mean squared share of the directions along the weakest of this many axes."""
    return float(np.linalg.eigvalsh(directions.T @ directions / max(1, len(directions)))[3 - rank])


def _check_spread(directions: Array, least: int, what: str, where: str, rank: int = 3) -> None:
    if len(directions) < least:
        raise ConfigurationError(f"{len(directions)} {what}, but {least} are needed", where=where, hint="Record more")
    if _spread(directions, rank) < LEAST_SPREAD:
        hint = "Turn the hand so that the fingertip points down, level and sideways"
        raise ConfigurationError(f"the {what} are all in nearly the same orientation", where=where, hint=hint)


def _angles(forces: Array, normals: Array) -> Array:
    """Angles between forces and unit normals, shape (n,)."""
    cosines = np.sum(forces * normals, axis=1) / np.linalg.norm(forces, axis=1)
    return np.asarray(np.arccos(np.clip(cosines, -1.0, 1.0)))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _bias(free: Array, down: Array) -> Array:
    """Constant part of the untouched wrenches, shape (6,): the rest turns with the direction of the weight."""
    columns = np.column_stack([np.ones(len(down)), down])
    return np.asarray(np.linalg.lstsq(columns, free, rcond=None)[0][0])


def _mounting(forces: Array, up: Array, weights: Array, down: Array, where: str) -> Array:
    """Rotation from the distal frame into the sensor's, from presses about upwards and weights downwards.

    Raises:
        ConfigurationError: soft presses, the opposite sign, or forces that fit no mounting.
    """
    size = np.linalg.norm(forces, axis=1)
    if size.min() < PRESS_N:
        hint = f"Press with {PRESS_N:g} N or more"
        raise ConfigurationError(f"a press of only {size.min():.2f} N", where=where, hint=hint)
    directions = forces / size[:, None]
    pulled = weights.T @ down / max(_rms(weights), 1e-9)
    aligned = directions.T @ up + pulled
    rotation, mirrored = nearest_rotation(aligned), nearest_rotation(-aligned)
    angles, opposite = _angles(forces, up @ rotation.T), _angles(-forces, up @ mirrored.T)
    if np.linalg.det(aligned) < 0.0 and opposite.mean() < angles.mean():  # no rotation turns all directions over
        hint = "The sensor reports the force of the tip on the finger: set its tool transformation, or swap the sign"
        raise ConfigurationError("forces have the opposite sign", where=where, hint=hint)
    if angles.mean() > LARGEST_TILT_rad:
        what = f"forces are {np.degrees(angles.mean()):.0f} deg off the plate's normal for every mounting"
        raise ConfigurationError(what, where=where, hint="Press without sliding, on a level plate")
    return rotation


def _calibration(before: FingertipCalibration, found: Refined) -> FingertipCalibration:
    roll, pitch, yaw = Rot3(found.sensor_R_distal.T).xyz().tolist()
    mounting = RigidTransform(translation_m=before.distal_T_sensor.translation_m, rpy_rad=(roll, pitch, yaw))
    changes = {
        "distal_T_sensor": mounting,
        "mass_kg": found.mass_kg,
        "com_distal_m": tuple(map(float, found.com_distal_m)),
        "centre_distal_m": tuple(map(float, found.centre_distal_m)),
        "semi_axes_m": tuple(map(float, found.semi_axes_m)),
    }
    return before.model_copy(update=changes)
