"""The record of a fingertip's calibration: the rig's fingertips with one of them new, and its verdict."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from pydantic import Field

from calibration.admission import Installation
from calibration.fingertip_data import FingertipData
from calibration.fingertip_fit import FingertipFit
from calibration.quality import Judgement
from calibration.store import CalibrationRecord, new_record
from drivers.fingertip import FingertipCalibration, FingertipCalibrationFile
from tactile_lab.strict_yaml import StrictModel


class FingertipLimits(StrictModel):
    """What a fingertip's calibration must keep to, to pass.

    Attributes:
        force_mN: what is left of the untouched forces, root mean square per axis.
        lever_mm: what is left of the presses' torques, as a lever.
        tilt_deg: between the presses' forces and the plate's normal, root mean square.
        mass_g, com_mm, mounting_deg, centre_mm: standard deviations of what was found.
    """

    force_mN: float = Field(default=30.0, gt=0.0)
    lever_mm: float = Field(default=0.8, gt=0.0)
    tilt_deg: float = Field(default=30.0, gt=0.0)
    mass_g: float = Field(default=1.0, gt=0.0)
    com_mm: float = Field(default=2.0, gt=0.0)
    mounting_deg: float = Field(default=5.0, gt=0.0)
    centre_mm: float = Field(default=2.0, gt=0.0)


def judge_fingertip(fit: FingertipFit, limits: FingertipLimits | None = None) -> tuple[Judgement, ...]:
    """The figures of a fit against their limits."""
    limits, sigmas = limits or FingertipLimits(), fit.sigmas
    return (
        Judgement("left of the untouched forces", 1e3 * fit.rms_force_N, limits.force_mN, "mN"),
        Judgement("left of the presses' levers", 1e3 * fit.rms_lever_m, limits.lever_mm, "mm"),
        Judgement("forces from the plate's normal", float(np.degrees(fit.tilt_rad)), limits.tilt_deg, "deg"),
        Judgement("sigma of the mass", 1e3 * sigmas["mass_kg"], limits.mass_g, "g"),
        Judgement("sigma of the centre of mass", 1e3 * sigmas["com_m"], limits.com_mm, "mm"),
        Judgement("sigma of the mounting", float(np.degrees(sigmas["mounting_rad"])), limits.mounting_deg, "deg"),
        Judgement("sigma of the ellipsoid's centre", 1e3 * sigmas["centre_m"], limits.centre_mm, "mm"),
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
        residuals={judgement.name: judgement.value for judgement in judged},
        limits=limits.model_dump(),
        details={
            "finger": data.finger,
            "turned_deg": float(np.degrees(fit.turned_rad)),
            "sigmas": {name: float(sigma) for name, sigma in fit.sigmas.items()},
            "free": len(data.free),
            "presses": len(data.presses),
        },
        verdict="PASS" if all(judgement.ok for judgement in judged) else "FAIL",
        notes=notes,
    )
