"""The record of a fingertip's calibration: the rig's fingertips with one of them new, and its verdict."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from pydantic import Field

from calibration.fingertip.data import FingertipData
from calibration.fingertip.fit import FingertipFit
from calibration.steps.quality import Judgement
from calibration.store.admission import Installation
from calibration.store.store import CalibrationRecord, Covariance, new_record
from drivers.core.configuration import StrictModel
from drivers.core.fingertip import FingertipCalibration, FingertipCalibrationFile

COVARIANCE_ROWS = (
    *(f"mounting_{axis}_rad" for axis in "xyz"),
    "mass_kg",
    *(f"{part}_{axis}_m" for part in ("com", "centre", "semi_axis") for axis in "xyz"),
)
"""Rows of the stored covariance; all in the distal frame."""


class FingertipLimits(StrictModel):
    """Limits of a fingertip's calibration.

    Attributes:
        force_mN: residual of the untouched forces, root mean square per axis.
        lever_mm: residual of the presses' torques, as a lever.
        tilt_deg: between the presses' forces and the plate's normal, root mean square.
        noise: of the residuals, relative to the stated noise.
        mass_g, com_mm, mounting_deg, centre_mm: standard deviations of the result.
    """

    force_mN: float = Field(default=30.0, gt=0.0)
    lever_mm: float = Field(default=0.8, gt=0.0)
    tilt_deg: float = Field(default=30.0, gt=0.0)
    noise: float = Field(default=2.0, gt=0.0)
    mass_g: float = Field(default=1.0, gt=0.0)
    com_mm: float = Field(default=2.0, gt=0.0)
    mounting_deg: float = Field(default=3.0, gt=0.0)
    centre_mm: float = Field(default=2.0, gt=0.0)


def judge_fingertip(fit: FingertipFit, limits: FingertipLimits | None = None) -> tuple[Judgement, ...]:
    """The checks of a fit against their limits."""
    limits = limits or FingertipLimits()
    return (
        Judgement("left of the untouched forces", 1e3 * fit.rms_force_N, limits.force_mN, "mN"),
        Judgement("left of the presses' levers", 1e3 * fit.rms_lever_m, limits.lever_mm, "mm"),
        Judgement("forces from the plate's normal", float(np.degrees(fit.tilt_rad)), limits.tilt_deg, "deg"),
        Judgement("noise relative to the stated", float(np.sqrt(fit.variance_factor)), limits.noise, ""),
        Judgement("sigma of the mass", 1e3 * fit.sigma("mass"), limits.mass_g, "g"),
        Judgement("sigma of the centre of mass", 1e3 * fit.sigma("com"), limits.com_mm, "mm"),
        Judgement("sigma of the mounting", float(np.degrees(fit.sigma("mounting"))), limits.mounting_deg, "deg"),
        Judgement("sigma of the ellipsoid's centre", 1e3 * fit.sigma("centre"), limits.centre_mm, "mm"),
    )


def fingertip_record(
    data: FingertipData,
    fit: FingertipFit,
    tips: Mapping[str, FingertipCalibration],
    here: Installation,
    notes: str = "",
    limits: FingertipLimits | None = None,
) -> CalibrationRecord:
    """The record, for the store."""
    limits = limits or FingertipLimits()
    serial = {f"ft/{data.finger}": data.serial} if data.serial else {}
    known = {device: number for device, number in here.devices.items() if device.startswith("ft/")}
    judged = judge_fingertip(fit, limits)
    return new_record(
        "fingertips",
        rig=here.rig,
        devices={**known, **serial},
        method=f"weight, press and roll of {data.finger}",
        parameters=FingertipCalibrationFile(fingertips={**tips, data.finger: fit.calibration}),
        covariance=Covariance.from_matrix(COVARIANCE_ROWS, fit.covariance),
        residuals={judgement.name: judgement.value for judgement in judged},
        limits=limits.model_dump(),
        details={
            "finger": data.finger,
            "turned_deg": float(np.degrees(fit.turned_rad)),
            "variance_factor": fit.variance_factor,
            "free": len(data.free),
            "presses": len(data.presses),
        },
        verdict="PASS" if all(judgement.ok for judgement in judged) else "FAIL",
        notes=notes,
    )
