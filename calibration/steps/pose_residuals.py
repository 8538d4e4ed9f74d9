"""Residuals of the poses of a calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class PoseResidual:
    """One pose.

    Attributes:
        label: what it was.
        distance_m: distance of the observation from its prediction.
        angle_rad: the same for its direction; None where the observation has none.
        pixels: root mean square of a picture's corners; None without a picture.
    """

    label: str
    distance_m: float
    angle_rad: float | None = None
    pixels: float | None = None


def rms_m(residuals: Sequence[PoseResidual]) -> float:
    """Root mean square of the distances, metres."""
    return float(np.sqrt(np.mean([residual.distance_m**2 for residual in residuals])))


def rms_rad(residuals: Sequence[PoseResidual]) -> float | None:
    """Root mean square of the angles, radians; None where there is none."""
    angles = [residual.angle_rad for residual in residuals if residual.angle_rad is not None]
    return float(np.sqrt(np.mean(np.square(angles)))) if angles else None
