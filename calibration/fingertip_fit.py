"""What a force fingertip is like: its sensor's mounting, its weight, its shape, from wrenches in known orientations.

* Untouched, the hand turned: what the weight does gives mass and centre of mass, and the bias.
* Pressed on a level plate: the force points about up, which gives the sign of the readings and, roughly, the sensor's
  mounting angle; roughly, because of friction.
* Pressed and rolled on a plate: the torque tells where the force acts, which gives mounting and ellipsoid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from gtsam import Pose3, Rot3
from scipy.optimize import OptimizeResult, least_squares

from calibration.fingertip_data import FingertipData, WrenchPose
from calibration.hand_eye import nearest_rotation
from calibration.motion_check import Check, MotionReport
from drivers.fingertip import GRAVITY, FingertipCalibration, RigidTransform
from tactile_lab.errors import ConfigurationError
from tactile_lab.geometry.contacts import Array

LEAST_ORIENTATIONS, LEAST_PRESSES = 6, 6
LEAST_SPREAD = 0.05
"""Smallest mean squared share of directions along any axis: below it a direction was never turned to."""

PRESS_N = 0.3
LARGEST_TILT_rad = float(np.radians(40.0))
"""Of the forces from the plate's normal: friction allows some, and a finger gives way along itself."""

_LEVER_m, _WEIGHT_N, _FRICTION_rad, _SHAPE_m = 3e-4, 0.008, 0.3, 1e-3
"""Errors of a press's lever, of an untouched force with its drift, of a force's direction, and of the shape before."""


@dataclass(frozen=True, eq=False)
class FingertipFit:
    """What was found.

    Attributes:
        calibration: the new one.
        turned_rad: by how much the mounting differs from the one before.
        sigmas: standard deviations: mass (kg), centre of mass (m), mounting (rad), ellipsoid's centre and axes (m).
        rms_force_N: what is left of the untouched forces, per axis.
        rms_lever_m: what is left of the presses' torques, per newton and axis.
        tilt_rad: root mean square angle between the presses' forces and the plate's normal.
    """

    calibration: FingertipCalibration
    turned_rad: float
    sigmas: dict[str, float]
    rms_force_N: float
    rms_lever_m: float
    tilt_rad: float


def fit_fingertip(data: FingertipData, before: FingertipCalibration) -> FingertipFit:
    """Bias and weight, then the mounting, then the shape.

    Raises:
        ConfigurationError: too few or too similar orientations, soft presses, or readings of the opposite sign.
    """
    where = f"fingertip {data.finger}"
    down, up = -_up(data.free), _up(data.presses)
    _check_spread(down, LEAST_ORIENTATIONS, "untouched wrenches", where)
    free, pressed = (np.array([pose.wrench for pose in part]) for part in (data.free, data.presses))
    _check_spread(up, LEAST_PRESSES, "presses", where, rank=2)
    bias = _bias(free, down)
    start = _mounting(pressed[:, :3] - bias[:3], up, free[:, :3] - bias[:3], down, where)
    found = _refined(start, free - bias, down, pressed - bias, up, before)
    sensor_R_distal, shape = start @ Rot3.Expmap(found.x[:3]).matrix(), found.x[3:]
    place = np.array(before.distal_T_sensor.translation_m)
    weight = _weight(free - bias, down @ sensor_R_distal.T)
    loads = pressed - bias - _weights(weight, -up @ sensor_R_distal.T)
    rest = free - bias - _weights(weight, down @ sensor_R_distal.T)
    forces, torques = loads[:, :3] @ sensor_R_distal, loads[:, 3:] @ sensor_R_distal
    turned = Rot3(before.distal_T_sensor.pose().rotation().matrix() @ sensor_R_distal)
    return FingertipFit(
        calibration=_calibration(before, sensor_R_distal, weight, shape, place),
        turned_rad=float(np.linalg.norm(Rot3.Logmap(turned))),
        sigmas=_sigmas(rest, found, weight[0]),
        rms_force_N=_rms(rest[:, :3]),
        rms_lever_m=_rms(_levers(shape, forces, torques, up, place)),
        tilt_rad=_rms(_angles(forces, up)),
    )


def wrench_motion(data: FingertipData) -> MotionReport:
    """Whether the orientations in some data are enough, and what is missing."""
    turn = "turn the hand so that the fingertip points down, level, sideways and up"
    return MotionReport(
        (
            Check("untouched wrenches", len(data.free), LEAST_ORIENTATIONS, "", "take more"),
            Check("spread of their orientations", _spread(_up(data.free), 3), LEAST_SPREAD, "of 0.33", turn),
            Check("presses", len(data.presses), LEAST_PRESSES, "", "press more"),
            Check("spread of their orientations", _spread(_up(data.presses), 2), LEAST_SPREAD, "of 0.5", "roll more"),
        )
    )


def _up(poses: Sequence[WrenchPose]) -> Array:
    """The world's z axis in each distal frame, shape (n, 3)."""
    return np.array([pose.world_R_distal[2] for pose in poses]).reshape(-1, 3)


def _spread(directions: Array, rank: int) -> float:
    """Mean squared share of the directions along the weakest of so many axes."""
    return float(np.linalg.eigvalsh(directions.T @ directions / max(1, len(directions)))[3 - rank])


def _check_spread(directions: Array, least: int, what: str, where: str, rank: int = 3) -> None:
    if len(directions) < least:
        raise ConfigurationError(f"{len(directions)} {what}, {least} needed", where=where, hint="Record more")
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
        hint = "The sensor reports what the tip does to the finger: set its tool transformation, or swap the sign"
        raise ConfigurationError("forces have the opposite sign", where=where, hint=hint)
    if angles.mean() > LARGEST_TILT_rad:
        what = f"forces are {np.degrees(angles.mean()):.0f} deg from the plate's normal, whatever the mounting"
        raise ConfigurationError(what, where=where, hint="Press without sliding, on a level plate")
    return rotation


def _weight(free: Array, down_sensor: Array) -> Array:
    """Mass (kg) and mass times centre of mass (kg m) in the sensor frame, shape (4,), by least squares."""
    rows = []
    for direction in GRAVITY * down_sensor:
        x, y, z = direction
        cross = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # (m c) x g
        rows += [np.column_stack([direction, np.zeros((3, 3))]), np.column_stack([np.zeros(3), cross])]
    scale = np.tile(np.repeat([1.0, 100.0], 3), len(free))  # a torque of 0.1 N mm is about as sure as 10 mN
    left, right = np.concatenate(rows) * scale[:, None], free.ravel() * scale
    return np.asarray(np.linalg.lstsq(left, right, rcond=None)[0])


def _weights(weight: Array, down_sensor: Array) -> Array:
    """Wrenches of the weight, shape (n, 6), sensor frame."""
    forces = weight[0] * GRAVITY * down_sensor
    return np.hstack([forces, np.cross(weight[1:], GRAVITY * down_sensor)])


def _levers(shape: Array, forces: Array, torques: Array, up: Array, place: Array) -> Array:
    """What the contact points of a shape on a level plate leave of the torques, per newton, shape (n, 3), metres."""
    centre, axes = shape[:3], shape[3:]
    points = centre - axes**2 * up / np.linalg.norm(axes * up, axis=1, keepdims=True)
    size = np.linalg.norm(forces, axis=1, keepdims=True)
    return np.asarray((torques - np.cross(points - place, forces)) / size)


def _refined(
    start: Array, free: Array, down: Array, pressed: Array, up: Array, before: FingertipCalibration
) -> OptimizeResult:
    """A turn from the mounting to start with, centre and semi-axes that explain weights, levers and directions.

    The levers tell the mounting whatever the friction; the shape stays near the one before where nothing tells it.
    """
    place, shape = np.array(before.distal_T_sensor.translation_m), _shape_before(before)

    def misfit(unknowns: Array) -> Array:
        rotation = start @ Rot3.Expmap(unknowns[:3]).matrix()
        weight = _weight(free, down @ rotation.T)
        loads = pressed - _weights(weight, -up @ rotation.T)
        forces, torques = loads[:, :3] @ rotation, loads[:, 3:] @ rotation
        weights = free[:, :3] - weight[0] * GRAVITY * down @ rotation.T
        directions = forces / np.linalg.norm(forces, axis=1, keepdims=True) - up
        parts = (
            _levers(unknowns[3:], forces, torques, up, place) / _LEVER_m,
            weights / _WEIGHT_N,
            directions / _FRICTION_rad,
            (unknowns[3:] - shape) / _SHAPE_m,
        )
        return np.concatenate([part.ravel() for part in parts])

    scale = np.repeat([0.1, 1e-3], [3, 6])
    return least_squares(misfit, np.concatenate([np.zeros(3), shape]), x_scale=scale)


def _shape_before(before: FingertipCalibration) -> Array:
    return np.array([*before.centre_distal_m, *before.semi_axes_m])


def _calibration(
    before: FingertipCalibration, sensor_R_distal: Array, weight: Array, shape: Array, place: Array
) -> FingertipCalibration:
    distal_R_sensor = sensor_R_distal.T
    roll, pitch, yaw = Rot3(distal_R_sensor).xyz().tolist()
    mounting = RigidTransform(translation_m=before.distal_T_sensor.translation_m, rpy_rad=(roll, pitch, yaw))
    com = Pose3(Rot3(distal_R_sensor), place).transformFrom(weight[1:] / max(weight[0], 1e-6))
    changes = {
        "distal_T_sensor": mounting,
        "mass_kg": float(max(weight[0], 0.0)),
        "com_distal_m": tuple(map(float, com)),
        "centre_distal_m": tuple(map(float, shape[:3])),
        "semi_axes_m": tuple(map(float, shape[3:])),
    }
    return before.model_copy(update=changes)


def _sigmas(rest: Array, found: OptimizeResult, mass_kg: float) -> dict[str, float]:
    force, torque = _rms(rest[:, :3]), _rms(rest[:, 3:])
    weight_N = max(GRAVITY * mass_kg, 1e-9) * float(np.sqrt(len(rest)))
    spread = np.linalg.pinv(found.jac.T @ found.jac) * max(1.0, float(np.mean(np.square(found.fun))))
    variances = np.diag(spread)
    return {
        "mass_kg": force / GRAVITY / float(np.sqrt(len(rest))),
        "com_m": float(torque / weight_N),
        "mounting_rad": float(np.sqrt(variances[:3].sum())),
        "centre_m": float(np.sqrt(variances[3:6].sum())),
        "semi_axes_m": float(np.sqrt(variances[6:].sum())),
    }
