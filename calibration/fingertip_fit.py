"""What a force fingertip is like: its sensor's mounting, its weight, its shape, from wrenches in known orientations.

* Untouched, the hand turned: what the weight does gives mass and centre of mass, and the bias.
* Pressed on a level plate: the force points up, which gives the sensor's mounting angle and the sign of its readings.
* Pressed and rolled on a plate: the torque tells where the force acts, which gives the ellipsoid.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from gtsam import Pose3, Rot3
from pydantic import Field
from scipy.optimize import OptimizeResult, least_squares

from calibration.admission import Installation
from calibration.hand_eye import nearest_rotation
from drivers.fingertip import GRAVITY, FingertipCalibration, RigidTransform, Vector3
from tactile_lab.errors import ConfigurationError
from tactile_lab.geometry.contacts import Array
from tactile_lab.strict_yaml import StrictModel, load, validate

LEAST_ORIENTATIONS, LEAST_PRESSES = 6, 6
LEAST_SPREAD = 0.05
"""Smallest mean squared share of directions along any axis: below it a direction was never turned to."""

PRESS_N = 0.5
LARGEST_TILT_rad = float(np.radians(20.0))

Square3 = tuple[Vector3, Vector3, Vector3]
Six = tuple[float, float, float, float, float, float]


class WrenchPose(StrictModel):
    """A mean wrench, N and N m, sensor frame, in a known orientation of the distal frame in the world (z up)."""

    world_R_distal: Square3
    wrench: Six


class FingertipData(StrictModel):
    """A file of wrenches of one finger.

    Attributes:
        free: untouched, in several orientations.
        presses: on a level plate from above, force upwards, in several orientations (rolled about).
    """

    format: Literal["tactile-fingertip-data/1"] = "tactile-fingertip-data/1"
    rig: str = Field(min_length=1)
    finger: Literal["FF", "MF", "RF", "LF", "TH"]
    serial: str = ""
    free: tuple[WrenchPose, ...]
    presses: tuple[WrenchPose, ...]


@dataclass(frozen=True, eq=False)
class FingertipFit:
    """What was found.

    Attributes:
        calibration: the new one.
        turned_rad: by how much the mounting differs from the one before.
        sigmas: standard deviations: mass (kg), centre of mass (m), mounting (rad), ellipsoid's centre and axes (m).
        rms_force_N, rms_torque_Nm: what is left of the untouched wrenches, and of the presses' torques.
    """

    calibration: FingertipCalibration
    turned_rad: float
    sigmas: dict[str, float]
    rms_force_N: float
    rms_torque_Nm: float


def load_fingertip_data(path: Path, here: Installation) -> FingertipData:
    """Read wrenches of this rig. Raises ConfigurationError."""
    data = validate(load(path), FingertipData, where=str(path))
    if data.rig != here.rig:
        hint = "Name the rig they are of with --rig"
        raise ConfigurationError(f"was recorded on rig {data.rig}, not on {here.rig}", where=str(path), hint=hint)
    return data


def fit_fingertip(data: FingertipData, before: FingertipCalibration) -> FingertipFit:
    """Bias and weight, then the mounting, then the shape.

    Raises:
        ConfigurationError: too few or too similar orientations, soft presses, or readings of the opposite sign.
    """
    where = f"fingertip {data.finger}"
    down = np.array([-np.array(pose.world_R_distal)[2] for pose in data.free])
    _check_spread(down, LEAST_ORIENTATIONS, "untouched wrenches", where)
    free, pressed = (np.array([pose.wrench for pose in part]) for part in (data.free, data.presses))
    up = np.array([np.array(pose.world_R_distal)[2] for pose in data.presses])
    _check_spread(up, LEAST_PRESSES, "presses", where, rank=2)
    bias = _bias(free, down)
    sensor_R_distal = _mounting(pressed[:, :3] - bias[:3], up, where)
    weight = _weight(free - bias, down @ sensor_R_distal.T)
    place = np.array(before.distal_T_sensor.translation_m)
    loads = pressed - bias - _weights(weight, -up @ sensor_R_distal.T)
    shape = _shape(loads, sensor_R_distal, place, before)
    rest = free - bias - _weights(weight, down @ sensor_R_distal.T)
    turned = Rot3(before.distal_T_sensor.pose().rotation().matrix() @ sensor_R_distal)
    return FingertipFit(
        calibration=_calibration(before, sensor_R_distal, weight, shape.x, place),
        turned_rad=float(np.linalg.norm(Rot3.Logmap(turned))),
        sigmas=_sigmas(rest, shape, len(data.free)),
        rms_force_N=float(np.sqrt(np.mean(rest[:, :3] ** 2))),
        rms_torque_Nm=float(np.sqrt(np.mean(np.square(shape.fun)))),
    )


def _check_spread(directions: Array, least: int, what: str, where: str, rank: int = 3) -> None:
    if len(directions) < least:
        raise ConfigurationError(f"{len(directions)} {what}, {least} needed", where=where, hint="Record more")
    spread = np.linalg.eigvalsh(directions.T @ directions / len(directions))
    if spread[3 - rank] < LEAST_SPREAD:
        hint = "Turn the hand so that the fingertip points down, level and sideways"
        raise ConfigurationError(f"the {what} are all in nearly the same orientation", where=where, hint=hint)


def _bias(free: Array, down: Array) -> Array:
    """Constant part of the untouched wrenches, shape (6,): the rest turns with the direction of the weight."""
    columns = np.column_stack([np.ones(len(down)), down])
    return np.asarray(np.linalg.lstsq(columns, free, rcond=None)[0][0])


def _mounting(forces: Array, up: Array, where: str) -> Array:
    """Rotation from the distal frame into the sensor's, from forces that point up. Raises ConfigurationError."""
    size = np.linalg.norm(forces, axis=1)
    if size.min() < PRESS_N:
        hint = f"Press with {PRESS_N:g} N or more"
        raise ConfigurationError(f"a press of only {size.min():.2f} N", where=where, hint=hint)
    directions = forces / size[:, None]
    rotation = nearest_rotation(directions.T @ up)
    angles = np.arccos(np.clip(np.sum(directions * (up @ rotation.T), axis=1), -1.0, 1.0))
    opposite = np.arccos(
        np.clip(-np.sum(directions * (up @ nearest_rotation(-directions.T @ up).T), axis=1), -1.0, 1.0)
    )
    if opposite.mean() < 0.5 * angles.mean():
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


def _shape(loads: Array, sensor_R_distal: Array, place: Array, before: FingertipCalibration) -> OptimizeResult:
    """Centre and semi-axes whose contact points explain the torques, started from the shape before."""
    forces, torques = loads[:, :3] @ sensor_R_distal, loads[:, 3:] @ sensor_R_distal
    outward = -forces / np.linalg.norm(forces, axis=1, keepdims=True)
    size = np.linalg.norm(forces, axis=1, keepdims=True)
    start = np.array([*before.centre_distal_m, *before.semi_axes_m])

    def misfit(shape: Array) -> Array:
        centre, axes = shape[:3], shape[3:]
        scaled = axes * outward
        points = centre + axes * scaled / np.linalg.norm(scaled, axis=1, keepdims=True)
        sensed = (torques - np.cross(points - place, forces)) / size  # metres of lever
        return np.asarray(np.concatenate([sensed.ravel(), 0.05 * (shape - start)]))

    return least_squares(misfit, start, bounds=([-0.05] * 3 + [0.002] * 3, [0.05] * 3 + [0.03] * 3))


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


def _sigmas(rest: Array, shape: OptimizeResult, count: int) -> dict[str, float]:
    force, torque = (float(np.sqrt(np.mean(part**2))) for part in (rest[:, :3], rest[:, 3:]))
    spread = np.linalg.pinv(shape.jac.T @ shape.jac) * float(np.mean(np.square(shape.fun)))
    return {
        "mass_kg": force / GRAVITY / np.sqrt(max(1, count)),
        "com_m": torque / max(force, 1e-9) / np.sqrt(max(1, count)) if force else 0.0,
        "centre_m": float(np.sqrt(spread[:3, :3].trace())),
        "semi_axes_m": float(np.sqrt(spread[3:, 3:].trace())),
    }
