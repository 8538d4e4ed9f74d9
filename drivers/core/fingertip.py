"""The interface of fingertips: a load and a contact.

The *distal frame* of a finger is the child frame of its last joint J1: origin on the joint's axis, z along the
fingertip, -y to the palm side. The fingertip's surface is an ellipsoid whose axes are parallel to that frame's.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Protocol, runtime_checkable

import numpy as np
from gtsam import Pose3, Rot3
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from drivers.core.calibration_file import load_parameters
from drivers.core.configuration import StrictModel
from drivers.core.contacts import FINGERS, Array

GRAVITY = 9.80665
"""Standard gravity, m/s^2."""

Vector3 = tuple[float, float, float]
PositiveFloat = Annotated[float, Field(gt=0.0)]


@dataclass(frozen=True)
class TipBody:
    """Geometry and mass of one fingertip.

    Attributes:
        distal_T_sensor: the sensor's measuring frame in the distal frame.
        distal_T_skin: centre and axes of the ellipsoid that touches.
        semi_axes_m: its semi-axes.
        mass_kg: mass beyond the sensor.
        com_distal_m: its centre in the distal frame.
    """

    distal_T_sensor: Pose3
    distal_T_skin: Pose3
    semi_axes_m: tuple[float, float, float]
    mass_kg: float
    com_distal_m: tuple[float, float, float]


@dataclass(frozen=True)
class TipContact:
    """Where one fingertip touches the object, in the finger's distal frame.

    Attributes:
        point_distal_m: contact point, shape (3,).
        normal_distal: unit normal, shape (3,), out of the *object* (into the tip: minus the tip's own outward normal).
        point_covariance_m2: covariance of the point, shape (3, 3).
        normal_sigma_rad: standard deviation of the normal's direction, per axis.
        force_N: magnitude of the contact force.
        torsion_Nm: moment about ``normal_distal`` that the object applies to the tip (0 if it is not measured).
    """

    point_distal_m: Array
    normal_distal: Array
    point_covariance_m2: Array
    normal_sigma_rad: float
    force_N: float
    torsion_Nm: float


@dataclass(frozen=True)
class TipTouches:
    """What one fingertip felt at several moments, in the finger's distal frame.

    Attributes:
        points_distal_m: contact points, shape (n, 3); zero where :attr:`is_certain` is false.
        normals_distal: unit normals out of the *object*, shape (n, 3); zero likewise.
        normal_forces_N: force along the normal, shape (n,); zero likewise.
        forces_distal_N: force of the object on the fingertip, shape (n, 3); zero likewise.
        is_certain: whether the reading was that of one contact, shape (n,).
        is_void: whether the reading was no measurement (saturated, faulty), shape (n,).
    """

    points_distal_m: Array
    normals_distal: Array
    normal_forces_N: Array
    forces_distal_N: Array
    is_certain: NDArray[np.bool_]
    is_void: NDArray[np.bool_]


@runtime_checkable
class ContinuousFingertip(Protocol):
    """A fingertip that measures its contact at any moment, also while it moves (a force sensor does)."""

    def reading(self) -> Array:
        """The newest measurement without bias, shape (6,), sensor frame; NaN if it is invalid."""

    def touches(self, readings: Array, world_R_distal: Array) -> TipTouches:
        """The contacts of readings of shape (n, 6), with the distal frame's orientation at each, shape (n, 3, 3)."""

    def wrenches(self, readings: Array, world_R_distal: Array) -> Array:
        """The object's wrench on the fingertip, about the distal frame's origin and along its axes, shape (n, 6).

        NaN for a reading that is no measurement.
        """

    @property
    def drift(self) -> Array:
        """Drift of the readings since the tare, one standard deviation, N and N m, shape (6,)."""


class FingertipSensor(Protocol):
    """A fingertip of any kind. Each kind has its own ``update`` for its decoded samples.

    ``world_R_distal`` is the distal frame's orientation in the world (z up), shape (3, 3), for the direction of the
    tip's weight.
    """

    finger: str

    def tare(self, world_R_distal: Array, *, reason: str = "") -> None:
        """Tare with the newest samples. Raises DeviceError if they are unsuitable."""

    def load_N(self, world_R_distal: Array) -> float:
        """Contact force from the newest sample, for the stop threshold; infinite if it is invalid."""

    def void(self) -> str:
        """Why the newest sample is invalid; "" if it is valid."""

    def begin_capture(self) -> None:
        """From now on samples are collected for :meth:`contact`."""

    def contact(self, world_R_distal: Array) -> TipContact | None:
        """The contact from the samples since :meth:`begin_capture`; None without a certain contact."""

    def health(self) -> tuple[str, ...]:
        """Problems of the sensor as text; empty if there are none."""


@runtime_checkable
class PressureFingertip(Protocol):
    """A fingertip that feels a touch also where it cannot tell the place."""

    def pressed_N(self) -> float | None:
        """Force of the touch since ``begin_capture``; None without one."""


class RigidTransform(StrictModel):
    """A mounting: translation in metres, then fixed-axis roll, pitch, yaw in radians (Rz Ry Rx)."""

    translation_m: Vector3
    rpy_rad: Vector3 = (0.0, 0.0, 0.0)

    def pose(self) -> Pose3:
        """The transform as a gtsam pose."""
        roll, pitch, yaw = self.rpy_rad
        return Pose3(Rot3.Ypr(yaw, pitch, roll), np.array(self.translation_m))


class FingertipCalibration(StrictModel):
    """Shape, weight and mounting of one force-sensing fingertip.

    Attributes:
        semi_axes_m: semi-axes of the ellipsoid along the distal x, y, z.
        centre_distal_m: its centre in the distal frame.
        distal_T_sensor: pose of the sensor's measuring frame in the distal frame.
        mass_kg, com_distal_m: everything the sensor carries, and its centre of mass in the distal frame.
        shell_min_distal_m, shell_max_distal_m: the box in the distal frame outside which the tip has no shell, so that
            no contact there is valid; the shell on the Shadow hand covers the palm side only, y up to 5.1 mm.
        force_sigma_N, moment_sigma_Nm: noise of one sample, per axis.
        force_drift_N, moment_drift_Nm: drift since the tare, per axis, one standard deviation.
        point_floor_m, normal_floor_rad: error of shape and mounting that averaging does not reduce, per axis.
        yield_m, yield_exponent: how far the skin yields under a normal force of 1 N, and the power of the force with
            which that grows (2/3: a ball of an elastic material, Hertz). The contact is that much inside the ellipsoid.
    """

    semi_axes_m: tuple[PositiveFloat, PositiveFloat, PositiveFloat]
    centre_distal_m: Vector3
    distal_T_sensor: RigidTransform
    mass_kg: float = Field(ge=0.0)
    com_distal_m: Vector3
    shell_min_distal_m: Vector3 = (-1.0, -1.0, -1.0)
    shell_max_distal_m: Vector3 = (1.0, 1.0, 1.0)
    force_sigma_N: PositiveFloat = 1 / 320
    moment_sigma_Nm: PositiveFloat = 1e-3 / 64
    force_drift_N: float = Field(default=0.01, ge=0.0)
    moment_drift_Nm: float = Field(default=5e-5, ge=0.0)
    point_floor_m: float = Field(default=0.0003, ge=0.0)
    normal_floor_rad: float = Field(default=0.02, ge=0.0)
    yield_m: float = Field(default=0.0, ge=0.0, le=0.005)
    yield_exponent: float = Field(default=2 / 3, gt=0.0, le=1.0)

    def indentation_m(self, normal_force_N: Array) -> Array:
        """How far the skin is pressed in by forces along its normal, newton, of any shape."""
        return np.asarray(self.yield_m * np.maximum(normal_force_N, 0.0) ** self.yield_exponent)


def _known_fingers(fingertips: dict[str, FingertipCalibration]) -> dict[str, FingertipCalibration]:
    if unknown := sorted(set(fingertips) - set(FINGERS)):
        raise ValueError(f"unknown finger {', '.join(unknown)}; the fingers are {', '.join(FINGERS)}")
    return fingertips


class FingertipCalibrationFile(StrictModel):
    """A calibration file: one entry for each finger that carries a force sensor."""

    fingertips: Annotated[dict[str, FingertipCalibration], Field(min_length=1), AfterValidator(_known_fingers)]


def load_fingertips(path: Path) -> dict[str, FingertipCalibration]:
    """Read a fingertip calibration file: finger name to calibration.

    Raises:
        ConfigurationError: the file is missing, not strict YAML, or does not fit the model.
    """
    return load_parameters(path, FingertipCalibrationFile).fingertips
