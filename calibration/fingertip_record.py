"""The record of a fingertip's calibration: the rig's fingertips with one of them new."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from calibration.admission import Installation
from calibration.fingertip_fit import FingertipData, FingertipFit
from calibration.store import CalibrationRecord, new_record
from drivers.fingertip import FingertipCalibration, FingertipCalibrationFile


def fingertip_record(
    data: FingertipData,
    fit: FingertipFit,
    tips: Mapping[str, FingertipCalibration],
    here: Installation,
    notes: str = "",
) -> CalibrationRecord:
    """The record, for the store."""
    serial = {f"ft/{data.finger}": data.serial} if data.serial else {}
    known = {device: number for device, number in here.devices.items() if device.startswith("ft/")}
    return new_record(
        "fingertips",
        rig=here.rig,
        devices={**known, **serial},
        method=f"weight, press and roll of {data.finger}",
        parameters=FingertipCalibrationFile(fingertips={**tips, data.finger: fit.calibration}),
        residuals={"force_mN": 1e3 * fit.rms_force_N, "lever_mm": 1e3 * fit.rms_torque_Nm},
        details={
            "finger": data.finger,
            "turned_deg": float(np.degrees(fit.turned_rad)),
            "sigmas": fit.sigmas,
            "free": len(data.free),
            "presses": len(data.presses),
        },
        verdict="PASS",
        notes=notes,
    )
