"""The record of a forearm-to-world calibration: from a result, or from a stated pose."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any

import numpy as np
from gtsam import Pose3

from calibration.forearm.placement import AXES, ForearmCalibration
from calibration.forearm.recordings import ForearmData
from calibration.forearm.wizard import ForearmResult
from calibration.steps.quality import Quality
from calibration.store.admission import Installation
from calibration.store.store import VALID_DAYS, CalibrationRecord, Covariance, new_record
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.core.fingertip import RigidTransform
from drivers.shadow.model.hand_form import HandForm


def check_origin(data: ForearmData, here: Installation, where: str) -> None:
    """Refuse observations that were recorded on another rig or with other devices. Raises ConfigurationError."""
    hint = f"Record the poses on {here.rig}, or give the rig of the recording with --rig"
    if data.rig and data.rig != here.rig:
        raise ConfigurationError(f"was recorded on rig {data.rig}, not on {here.rig}", where=where, hint=hint)
    for device, serial in data.devices.items():
        if here.devices.get(device, serial) != serial:
            what = f"was recorded with {device} {serial}, not {here.devices[device]}"
            raise ConfigurationError(what, where=where, hint=hint)


def check_hand(data: ForearmData, form: HandForm, where: str) -> None:
    """Refuse touches and pictures of a hand of another form. Raises ConfigurationError."""
    if (data.touches or data.views) and data.form != form:
        what = f"was recorded with a {data.form}, but the rig has a {form}"
        raise ConfigurationError(what, where=where, hint="Give the rig of the recording with --rig")


def record_of(
    result: ForearmResult,
    here: Installation,
    *,
    notes: str = "",
    valid_days: float | None = VALID_DAYS,
    now: datetime | None = None,
) -> CalibrationRecord:
    """The record of a result, for the store."""
    solution, quality = result.solution, result.quality
    return new_record(
        "forearm",
        rig=here.rig,
        devices={device: serial for device, serial in here.devices.items() if device in ("hand", "base", "camera")},
        method=result.method,
        parameters=ForearmCalibration.of(solution.world_T_mount, solution.covariance),
        covariance=Covariance.from_matrix(AXES, solution.covariance),
        residuals=_residuals(quality),
        limits=result.limits.model_dump(),
        verdict="PASS" if quality.passed else "FAIL",
        details=_details(result),
        notes=notes,
        valid_days=valid_days,
        now=now,
    )


def manual_record(
    world_T_mount: Pose3,
    translation_sigma_m: float,
    rotation_sigma_rad: float,
    here: Installation,
    *,
    notes: str = "",
    valid_days: float | None = VALID_DAYS,
    now: datetime | None = None,
) -> CalibrationRecord:
    """The record of a pose that a person states, with the uncertainty that they state."""
    covariance = np.diag(np.repeat([rotation_sigma_rad, translation_sigma_m], 3) ** 2)
    return new_record(
        "forearm",
        rig=here.rig,
        devices={device: serial for device, serial in here.devices.items() if device in ("hand", "base")},
        method="manual",
        parameters=ForearmCalibration.of(world_T_mount, covariance),
        covariance=Covariance.from_matrix(AXES, covariance),
        verdict="PASS",
        details={
            "stated_sigma_mm": 1e3 * translation_sigma_m,
            "stated_sigma_deg": float(np.degrees(rotation_sigma_rad)),
        },
        notes=notes,
        valid_days=valid_days,
        now=now,
    )


def _residuals(quality: Quality) -> dict[str, Any]:
    def degrees(value: float | None) -> float | None:
        return None if value is None else float(np.degrees(value))

    return {
        "rms_mm": 1e3 * quality.residual_m,
        "rms_deg": degrees(quality.residual_rad),
        "held_out_mm": 1e3 * quality.held_out_m,
        "held_out_deg": degrees(quality.held_out_rad),
        "leave_one_out_mm": 1e3 * quality.repeat_m,
        "leave_one_out_deg": degrees(quality.repeat_rad),
        "region_95_mm": [1e3 * axis for axis in quality.region_m],
        "region_95_deg": [float(np.degrees(axis)) for axis in quality.region_rad],
        "outliers": list(quality.outliers),
        "poses": [
            {"pose": r.label, "mm": 1e3 * r.distance_m, "deg": degrees(r.angle_rad), "px": r.pixels}
            for r in quality.residuals
        ],
    }


def _details(result: ForearmResult) -> dict[str, Any]:
    offsets = {
        joint: {
            "deg": float(np.degrees(offset.offset_rad)),
            "sigma_deg": float(np.degrees(offset.sigma_rad)),
            "observable": offset.observable,
        }
        for joint, offset in result.solution.offsets.items()
    }
    return {
        "variance_factor": result.solution.variance_factor,
        "joint_offsets": offsets,
        **result.solution.numbers,
        **{name: _transform(pose) for name, pose in result.solution.others.items()},
        "motion": {check.name: check.value for check in result.motion.checks},
    }


def _transform(pose: Pose3) -> dict[str, list[float]]:
    rotation: Array = pose.rotation().xyz()
    return {
        "translation_m": [float(value) for value in pose.translation()],
        "rpy_rad": [float(value) for value in rotation],
    }


def transform_of(translation_m: Sequence[float], rpy_deg: Sequence[float]) -> Pose3:
    """A pose from metres and degrees, roll, pitch, yaw about fixed axes."""
    x, y, z = translation_m
    roll, pitch, yaw = np.radians(rpy_deg).tolist()
    return RigidTransform(translation_m=(x, y, z), rpy_rad=(roll, pitch, yaw)).pose()
