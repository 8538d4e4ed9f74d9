"""Model of a fingertip's wrenches given its mounting, weight and shape, and its joint estimation.

One joint least-squares problem over all readings: bias, weight, mounting, ellipsoid, and the force of every press.
Forces and torques have the sensor's own noise and drift; the drift of readings near in time is nearly the same, so
they do not count as independent. A press's force may point anywhere: friction and a yielding finger do no harm, as only
the point of action is used. Errors of the joint angles rotate all readings alike and cannot be separated from the
mounting; they are an unknown with the stated prior, and so widen the result.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from gtsam import Rot3
from pydantic import Field
from scipy.optimize import least_squares

from calibration.fingertip.data import FingertipData, WrenchPose
from drivers.core.configuration import StrictModel
from drivers.core.contacts import FINGERS, Array
from drivers.core.fingertip import GRAVITY, FingertipCalibration
from drivers.shadow.closing.posture import finger_joints
from drivers.shadow.model.kinematics import JOINT_INDEX, palm_T_distal_matrices
from drivers.shadow.protocol.palm_images import Side

Part: TypeAlias = Literal["mounting", "mass", "com", "centre", "semi_axes"]

PARTS: dict[Part, slice] = {
    "mounting": slice(0, 3),
    "mass": slice(3, 4),
    "com": slice(4, 7),
    "centre": slice(7, 10),
    "semi_axes": slice(10, 13),
}
"""Rows of :attr:`Refined.covariance`: radians about the distal axes, kg, and metres in the distal frame."""

_TURN, _SHAPE, _MASS, _MOMENT = slice(0, 3), slice(3, 9), slice(9, 10), slice(10, 13)
_BIAS, _JOINTS, _FIXED = slice(13, 19), slice(19, 22), 22
_SCALE = np.repeat([0.1, 1e-3, 1e-3, 1e-5, 0.1, 1e-3, 0.02], [3, 6, 1, 3, 3, 3, 3])
"""Sizes of the unknowns: turn (rad), centre and semi-axes (m), mass (kg), mass times centre of mass from the sensor
(kg m), bias (N, N m), common turn by the joints' errors (rad); then comes the force of each press, N."""

_READINGS, _STEP_rad, _ROUNDS, _ENOUGH = 10, 1e-4, 2, 1e-6


class FingertipNoise(StrictModel):
    """Errors besides the sensor's own, which are in the fingertip's file; one standard deviation each.

    Attributes:
        joint_deg: constant offset of each joint of the finger.
        level_deg: of the plate, the mount and the wrist together, per axis.
        drift_s: correlation time of the sensor's drift.
        contact_mm: of a contact point, per axis: shape of the tip beyond its ellipsoid.
        shape_mm: prior of the ellipsoid, each coordinate and semi-axis.
    """

    joint_deg: float = Field(default=0.6, ge=0.0)
    level_deg: float = Field(default=0.1, gt=0.0)
    drift_s: float = Field(default=20.0, gt=0.0)
    contact_mm: float = Field(default=0.1, gt=0.0)
    shape_mm: float = Field(default=1.0, gt=0.0)


@dataclass(frozen=True, eq=False)
class Refined:
    """The refined result.

    Attributes:
        sensor_R_distal: the mounting, shape (3, 3).
        mass_kg: beyond the sensor.
        com_distal_m, centre_distal_m, semi_axes_m: shape (3,) each.
        covariance: of all of them, shape (13, 13), see :data:`PARTS`.
        variance_factor: squared residuals over what the stated noise allows; about 1 when the noise is as stated.
        rest: residuals of the untouched readings, shape (n, 6), N and N m.
        forces_distal_N: of the presses, shape (m, 3).
        rest_lever_m: residuals of the presses' torques, per newton, shape (m, 3).
    """

    sensor_R_distal: Array
    mass_kg: float
    com_distal_m: Array
    centre_distal_m: Array
    semi_axes_m: Array
    covariance: Array
    variance_factor: float
    rest: Array
    forces_distal_N: Array
    rest_lever_m: Array


def ups(poses: Sequence[WrenchPose]) -> Array:
    """The world's z axis in each distal frame, shape (n, 3)."""
    return np.array([pose.world_R_distal[2] for pose in poses]).reshape(-1, 3)


def wrenches(poses: Sequence[WrenchPose]) -> Array:
    """Shape (n, 6), N and N m, sensor frame."""
    return np.array([pose.wrench for pose in poses]).reshape(-1, 6)


def refine(data: FingertipData, before: FingertipCalibration, start: Array, noise: FingertipNoise) -> Refined:
    """The best fit to all readings, from a rough rotation of the distal frame into the sensor's."""
    problem = _Problem(data, before, noise)
    unknowns, rotation = problem.first(start), start
    for _ in range(_ROUNDS):  # again from where it ended, so that the turn is small and its covariance the rotation's
        found = least_squares(problem.misfit, unknowns, args=(rotation,), method="lm", ftol=_ENOUGH, xtol=_ENOUGH)
        rotation = rotation @ Rot3.Expmap(found.x[_TURN] * _SCALE[_TURN]).matrix()
        unknowns = found.x.copy()
        unknowns[_TURN] = 0.0
    return problem.answer(unknowns, rotation, np.asarray(found.jac))


class _Problem:
    """All readings of one finger, whitened by their noise."""

    def __init__(self, data: FingertipData, before: FingertipCalibration, noise: FingertipNoise) -> None:
        self._free, self._up = len(data.free), np.vstack([ups(data.free), ups(data.presses)])
        self._measured = np.vstack([wrenches(data.free), wrenches(data.presses)])
        self._place = np.array(before.distal_T_sensor.translation_m)
        self._shape = np.array([*before.centre_distal_m, *before.semi_axes_m])
        self._mass_kg, self._shape_m = before.mass_kg, 1e-3 * noise.shape_mm
        self._scale = np.concatenate([_SCALE, np.ones(3 * len(data.presses))])
        self._whiten_force, self._whiten_torque = self._whitening(data, before, noise)
        self._whiten_joints = np.linalg.inv(np.linalg.cholesky(orientation_covariance(data.finger, noise, data.side)))

    def _whitening(self, data: FingertipData, before: FingertipCalibration, noise: FingertipNoise) -> tuple[Array, ...]:
        """Inverse roots of the readings' covariances, forces' and torques', shape (n, n) each, the axes alike."""
        alike = _alike((*data.free, *data.presses), noise.drift_s)
        pressed = np.linalg.norm(self._measured[:, :3] - self._measured[: self._free, :3].mean(axis=0), axis=1)
        pressed[: self._free] = 0.0
        force = before.force_drift_N**2 * alike + before.force_sigma_N**2 / _READINGS * np.eye(len(alike))
        torque = before.moment_drift_Nm**2 * alike + before.moment_sigma_Nm**2 / _READINGS * np.eye(len(alike))
        torque += np.diag((1e-3 * noise.contact_mm * pressed) ** 2)
        return tuple(np.linalg.inv(np.linalg.cholesky(matrix)) for matrix in (force, torque))

    def first(self, rotation: Array) -> Array:
        """Unknowns to start with, in units of their scale."""
        bias = self._measured[: self._free].mean(axis=0)
        forces = (self._measured[self._free :, :3] - bias[:3]) @ rotation
        moment = self._mass_kg * (self._shape[:3] - self._place)
        values = [np.zeros(3), self._shape, [self._mass_kg], moment, bias, np.zeros(3), forces.ravel()]
        return np.asarray(np.concatenate(values) / self._scale)

    def misfit(self, unknowns: Array, rotation: Array) -> Array:
        """Whitened residuals of all readings, and of the prior."""
        values = unknowns * self._scale
        off = self._predict(values, rotation) - self._measured
        parts = (
            self._whiten_force @ off[:, :3],
            self._whiten_torque @ off[:, 3:],
            (values[_SHAPE] - self._shape) / self._shape_m,
            self._whiten_joints @ values[_JOINTS],
        )
        return np.concatenate([part.ravel() for part in parts])

    def _predict(self, values: Array, rotation: Array) -> Array:
        """Readings, shape (n, 6)."""
        turned = rotation @ Rot3.Expmap(values[_TURN]).matrix()
        up = self._up @ Rot3.Expmap(values[_JOINTS]).matrix()
        weight = -GRAVITY * up
        forces, torques = values[_MASS] * weight, np.cross(values[_MOMENT], weight)
        pressed, points = values[_FIXED:].reshape(-1, 3), lowest(values[_SHAPE], up[self._free :])
        forces[self._free :] += pressed
        torques[self._free :] += np.cross(points - self._place, pressed)
        return np.hstack([forces @ turned.T, torques @ turned.T]) + values[_BIAS]

    def answer(self, unknowns: Array, rotation: Array, jacobian: Array) -> Refined:
        """The result, with its covariance and the residuals of the readings."""
        values = unknowns * self._scale
        rest = self._measured - self._predict(values, rotation)
        forces = values[_FIXED:].reshape(-1, 3)
        mass = float(values[_MASS][0])
        factor = float(np.sum(np.square(self.misfit(unknowns, rotation)))) / (len(jacobian) - len(unknowns))
        spread = np.linalg.inv(jacobian.T @ jacobian) * np.outer(self._scale, self._scale)
        picked = _report_derivative(mass, values[_MOMENT])
        return Refined(
            sensor_R_distal=rotation,
            mass_kg=mass,
            com_distal_m=self._place + values[_MOMENT] / mass,
            centre_distal_m=values[_SHAPE][:3],
            semi_axes_m=values[_SHAPE][3:],
            covariance=max(1.0, factor) * picked @ spread[:_FIXED, :_FIXED] @ picked.T,
            variance_factor=factor,
            rest=rest[: self._free],
            forces_distal_N=forces,
            rest_lever_m=rest[self._free :, 3:] / np.linalg.norm(forces, axis=1, keepdims=True),
        )


def lowest(shape: Array, up: Array) -> Array:
    """Where ellipsoids (centre and semi-axes, shape (6,)) touch a level plate below them, shape (n, 3)."""
    centre, axes = shape[:3], shape[3:]
    return np.asarray(centre - axes**2 * up / np.linalg.norm(axes * up, axis=1, keepdims=True))


def orientation_covariance(finger: str, noise: FingertipNoise, side: Side = "right") -> Array:
    """Of the distal frame's orientation by the joints' offsets and the level, distal axes, rad^2, shape (3, 3)."""
    angles = np.zeros((1 + len(finger_joints(finger)), len(JOINT_INDEX)))
    for row, joint in enumerate(finger_joints(finger)):
        angles[1 + row, JOINT_INDEX[joint]] = _STEP_rad
    links = palm_T_distal_matrices(angles, side)[:, FINGERS.index(finger), :3, :3]
    turns = np.array([Rot3.Logmap(Rot3(links[0].T @ link)) for link in links[1:]]) / _STEP_rad
    level = np.radians(noise.level_deg) ** 2 * np.eye(3)
    return np.asarray(np.radians(noise.joint_deg) ** 2 * turns.T @ turns + level)


def _alike(poses: Sequence[WrenchPose], drift_s: float) -> Array:
    """Correlation of the drift between readings, shape (n, n); those without a time are uncorrelated."""
    times = np.array([np.nan if pose.time_s is None else pose.time_s for pose in poses])
    alike = np.nan_to_num(np.exp(-np.abs(times[:, None] - times) / drift_s))
    np.fill_diagonal(alike, 1.0)
    return np.asarray(alike)


def _report_derivative(mass_kg: float, moment_kgm: Array) -> Array:
    """Derivative of the reported values by the unknowns, shape (13, 22)."""
    picked = np.zeros((13, _FIXED))
    picked[PARTS["mounting"], _TURN] = np.eye(3)
    picked[PARTS["mass"], _MASS] = 1.0
    picked[PARTS["com"], _MOMENT] = np.eye(3) / mass_kg
    picked[PARTS["com"], _MASS] = -moment_kgm[:, None] / mass_kg**2
    picked[7:, _SHAPE] = np.eye(6)
    return picked
