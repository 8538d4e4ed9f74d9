"""The forearm-to-world calibration file: the positioner's pose, and its uncertainty."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from gtsam import Pose3
from pydantic import Field, field_validator

from drivers.core.calibration_file import load_parameters
from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.fingertip import RigidTransform

Row = tuple[float, float, float, float, float, float]

AXES = ("rx_rad", "ry_rad", "rz_rad", "x_m", "y_m", "z_m")
"""Rows of the covariance: a small motion applied on the mount's side, in gtsam's order for Pose3."""

_ASYMMETRY = 1e-9


class ForearmCalibration(StrictModel):
    """Pose of the positioner's mount in the world.

    Attributes:
        world_T_mount: the pose.
        translation_sigma_m, rotation_sigma_rad: standard deviation per axis; used without
            ``covariance_mount``.
        covariance_mount: shape (6, 6), of a small motion applied on the mount's side, rotation [rad] first, then
            translation [m].
    """

    world_T_mount: RigidTransform
    translation_sigma_m: float = Field(ge=0.0)
    rotation_sigma_rad: float = Field(ge=0.0)
    covariance_mount: tuple[Row, Row, Row, Row, Row, Row] | None = None

    @field_validator("covariance_mount")
    @classmethod
    def _is_a_covariance(cls, value: tuple[Row, ...] | None) -> tuple[Row, ...] | None:
        if value is None:
            return None
        matrix = np.array(value)
        scale = float(np.abs(matrix).max())
        if np.abs(matrix - matrix.T).max() > _ASYMMETRY * scale or np.linalg.eigvalsh(matrix).min() < -1e-9 * scale:
            raise ValueError("is not a covariance: it must be symmetric, without negative variances")
        return value

    @classmethod
    def of(cls, world_T_mount: Pose3, covariance: Array) -> ForearmCalibration:
        """From a pose and its covariance, shape (6, 6), order of :data:`AXES`."""
        roll, pitch, yaw = world_T_mount.rotation().xyz()
        variances = np.maximum(np.diag(covariance), 0.0)
        rows = tuple(tuple(map(float, row)) for row in (covariance + covariance.T) / 2)
        return cls.model_validate(
            {
                "world_T_mount": {
                    "translation_m": tuple(map(float, world_T_mount.translation())),
                    "rpy_rad": (float(roll), float(pitch), float(yaw)),
                },
                "translation_sigma_m": float(np.sqrt(variances[3:].mean())),
                "rotation_sigma_rad": float(np.sqrt(variances[:3].mean())),
                "covariance_mount": rows,
            }
        )

    def covariance(self) -> Array:
        """Covariance, shape (6, 6), of rotation vector (first three, rad) and translation (last three, m)."""
        if self.covariance_mount is not None:
            return np.array(self.covariance_mount)
        sigmas = [self.rotation_sigma_rad] * 3 + [self.translation_sigma_m] * 3
        return np.diag(np.square(sigmas))


def load_forearm(path: Path) -> ForearmCalibration:
    """Read the file, stored or plain. Raises ConfigurationError."""
    return load_parameters(path, ForearmCalibration)
