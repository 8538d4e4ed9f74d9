"""The forearm-to-world calibration file: where the positioner stands, and how well that is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pydantic import Field

from drivers.fingertip import RigidTransform
from tactile_lab.geometry.contacts import Array
from tactile_lab.strict_yaml import StrictModel, load_model


class ForearmCalibration(StrictModel):
    """Pose of the positioner's mount in the world.

    Attributes:
        world_T_mount: the pose.
        translation_sigma_m, rotation_sigma_rad: standard deviation per axis.
    """

    world_T_mount: RigidTransform
    translation_sigma_m: float = Field(ge=0.0)
    rotation_sigma_rad: float = Field(ge=0.0)

    def covariance(self) -> Array:
        """Covariance, shape (6, 6), of rotation vector (first three, rad) and translation (last three, m)."""
        sigmas = [self.rotation_sigma_rad] * 3 + [self.translation_sigma_m] * 3
        return np.diag(np.square(sigmas))


def load_forearm(path: Path) -> ForearmCalibration:
    """Read the file. Raises ConfigurationError."""
    return load_model(path, ForearmCalibration)
