"""Joint offsets and gains: from poses with known angles, or from several fingers on a known rigid body.

A correction ``true = gain * measured + shift`` goes into the tables of the hand's own calibration file: the angle of
each point is replaced, so that reading them gives the corrected angle exactly.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field

from calibration.steps.refinement import JointOffset
from calibration.store.admission import Installation
from calibration.store.store import CalibrationRecord, Covariance, new_record
from drivers.core.calibration_file import check_seal, is_stored
from drivers.core.configuration import StrictModel, load, validate
from drivers.core.errors import ConfigurationError
from drivers.shadow.model.kinematics import JOINT_INDEX

GAIN_SPREAD_deg = 20.0
"""Least range of a joint's known angles for a gain; smaller ranges give only an offset."""

LARGEST_deg, LARGEST_GAIN = 15.0, 0.2
"""Largest plausible correction: beyond, the joint, the pose or the table is wrong."""


class JointLimits(StrictModel):
    """Limits of the corrections.

    Attributes:
        left_deg: residual of a joint's poses, root mean square.
        sigma_deg: standard deviation of a joint's shift.
        poses: least number per joint: a single pose cannot be checked.
    """

    left_deg: float = Field(default=1.0, gt=0.0)
    sigma_deg: float = Field(default=0.6, gt=0.0)
    poses: int = Field(default=2, ge=1)


class JointPose(StrictModel):
    """One pose: angles of some joints as known (by a jig, a plate) and as measured, degrees.

    Without measured angles it is still to be read from the hand.
    """

    name: str = ""
    known_deg: dict[str, float] = Field(min_length=1)
    measured_deg: dict[str, float] = Field(default_factory=dict)

    @property
    def unread(self) -> bool:
        """Whether nobody has stated measured angles."""
        return "measured_deg" not in self.model_fields_set


class JointPoses(StrictModel):
    """A file of poses."""

    format: Literal["tactile-joint-poses/1"] = "tactile-joint-poses/1"
    rig: str = Field(min_length=1)
    poses: tuple[JointPose, ...] = Field(min_length=1)


@dataclass(frozen=True)
class JointCorrection:
    """One joint's correction.

    Attributes:
        gain, shift_deg: ``true = gain * measured + shift``.
        sigma_deg: standard deviation of the shift at the middle of the poses.
        rms_deg: residual of the poses.
        poses: their number; 0 for a correction from contacts.
    """

    gain: float
    shift_deg: float
    sigma_deg: float
    rms_deg: float
    poses: int


def load_poses(path: Path, here: Installation) -> JointPoses:
    """Read a file of poses of this rig. Raises ConfigurationError."""
    poses = validate(load(path), JointPoses, where=str(path))
    if poses.rig != here.rig:
        hint = "Give the rig of the recording with --rig"
        raise ConfigurationError(f"was recorded on rig {poses.rig}, not on {here.rig}", where=str(path), hint=hint)
    for index, pose in enumerate(poses.poses):
        names = set(pose.known_deg) | set(pose.measured_deg)
        if unknown := sorted(names - set(JOINT_INDEX)):
            raise ConfigurationError(f"pose {index + 1} names unknown joints {', '.join(unknown)}", where=str(path))
        if not pose.unread and (missing := sorted(set(pose.known_deg) - set(pose.measured_deg))):
            raise ConfigurationError(f"pose {index + 1} has no measured {', '.join(missing)}", where=str(path))
    return poses


def from_poses(poses: Sequence[JointPose]) -> dict[str, JointCorrection]:
    """Corrections of all joints that some pose knows, by least squares; a gain where the angles are far apart."""
    joints = dict.fromkeys(joint for pose in poses for joint in pose.known_deg)
    return {joint: _fit(joint, [pose for pose in poses if joint in pose.known_deg]) for joint in joints}


def from_contacts(offsets: Mapping[str, JointOffset]) -> dict[str, JointCorrection]:
    """Corrections of those joints whose offset the contacts of a touch problem determine.

    Raises:
        ConfigurationError: they determine none.
    """
    found = {
        joint: JointCorrection(1.0, -float(np.degrees(o.offset_rad)), float(np.degrees(o.sigma_rad)), 0.0, 0)
        for joint, o in offsets.items()
        if o.observable
    }
    if not found:
        hint = "Press with several fingers, in several postures, with the hand turned"
        raise ConfigurationError("these contacts do not determine the offset of any joint", where="joints", hint=hint)
    return found


def _fit(joint: str, poses: Sequence[JointPose]) -> JointCorrection:
    known = np.array([pose.known_deg[joint] for pose in poses])
    measured = np.array([pose.measured_deg[joint] for pose in poses])
    with_gain = len(poses) >= 3 and float(np.ptp(known)) >= GAIN_SPREAD_deg
    middle = measured.mean()
    columns = np.column_stack([np.ones(len(poses)), measured - middle])[:, : 1 + with_gain]
    wanted = known if with_gain else known - (measured - middle)
    solution = np.linalg.lstsq(columns, wanted, rcond=None)[0]
    gain = float(solution[1]) if with_gain else 1.0
    rest = known - (solution[0] + gain * (measured - middle))
    rms = float(np.sqrt(np.mean(rest**2)))
    spare = max(1, len(poses) - 1 - with_gain)
    sigma = float(np.sqrt(np.sum(rest**2) / spare / len(poses)))
    return JointCorrection(gain, float(solution[0] - gain * middle), sigma, rms, len(poses))


def corrected_tables(path: Path, corrections: Mapping[str, JointCorrection]) -> dict[str, Any]:
    """The content of a hand's calibration file, stored or plain, with the corrections in its tables.

    Raises:
        ConfigurationError: the file cannot be used, or a correction is too large to be one.
    """
    content = load(path)
    if is_stored(content):
        check_seal(content, str(path))
        content = content["parameters"]
    _refuse_large(corrections)
    plain = [[joint, _move(table, corrections.get(joint))] for joint, table in content["sr_calibrations"]]
    coupled = [
        [pair, [_moved_pair(point, pair, corrections) for point in points]]
        for pair, points in content.get("sr_calibrations_coupled", [])
    ]
    return {"sr_calibrations": plain, "sr_calibrations_coupled": coupled}


def judge_joints(
    corrections: Mapping[str, JointCorrection], limits: JointLimits | None = None
) -> dict[str, tuple[str, ...]]:
    """What is outside its limit, by joint; empty if all pass."""
    limits = limits or JointLimits()
    return {joint: tuple(_faults(found, limits)) for joint, found in corrections.items()}


def _faults(found: JointCorrection, limits: JointLimits) -> Iterator[str]:
    if 0 < found.poses < limits.poses:
        yield f"{found.poses} pose, {limits.poses} needed"
    if not found.rms_deg <= limits.left_deg:
        yield f"residual {found.rms_deg:.2f} deg, limit {limits.left_deg:.2f}"
    if not found.sigma_deg <= limits.sigma_deg:
        yield f"sigma {found.sigma_deg:.2f} deg, limit {limits.sigma_deg:.2f}"


def joints_record(
    path: Path,
    corrections: Mapping[str, JointCorrection],
    method: str,
    here: Installation,
    notes: str = "",
    *,
    trusted: bool = True,
    limits: JointLimits | None = None,
    offsets: Mapping[str, JointOffset] | None = None,
    covariance: Covariance | None = None,
) -> CalibrationRecord:
    """The record of corrected tables; it fails when a joint is outside its limits.

    Args:
        path: the hand's tables so far.
        corrections: by joint.
        method, here, notes: for the record.
        trusted: whether what the corrections were found from kept to its own limits.
        limits: of the joints.
        offsets: all joints that were to be calibrated, including those that the contacts do not determine.
        covariance: of those offsets.

    Raises:
        ConfigurationError: the tables cannot be used, or a correction is too large to be one.
    """
    limits = limits or JointLimits()
    passed = trusted and not any(judge_joints(corrections, limits).values())
    return new_record(
        "joints",
        rig=here.rig,
        devices={device: serial for device, serial in here.devices.items() if device == "hand"},
        method=method,
        parameters=corrected_tables(path, corrections),
        covariance=covariance,
        residuals={joint: found.rms_deg for joint, found in corrections.items()},
        details=_untold(offsets or {})
        | {
            joint: {
                "gain": found.gain,
                "shift_deg": found.shift_deg,
                "sigma_deg": found.sigma_deg,
                "poses": found.poses,
            }
            for joint, found in corrections.items()
        },
        limits={"shift_deg": LARGEST_deg, "gain": LARGEST_GAIN, **limits.model_dump()},
        verdict="PASS" if passed else "FAIL",
        notes=notes,
    )


def _untold(offsets: Mapping[str, JointOffset]) -> dict[str, Any]:
    """The record of joints whose offset the contacts do not determine: their tables are unchanged."""
    return {
        joint: {"told": False, "sigma_deg": float(np.degrees(found.sigma_rad))}
        for joint, found in offsets.items()
        if not found.observable
    }


def _refuse_large(corrections: Mapping[str, JointCorrection]) -> None:
    for joint, found in corrections.items():
        if abs(found.shift_deg) > LARGEST_deg or abs(found.gain - 1.0) > LARGEST_GAIN:
            what = f"the correction of {joint} is {found.shift_deg:+.1f} deg and a gain of {found.gain:.2f}"
            hint = "Check the joint's name, the pose and the table; a correction may be at most 15 deg and 20 %"
            raise ConfigurationError(what, where="joints", hint=hint)


def _move(table: Any, correction: JointCorrection | None) -> list[list[float]]:
    return [[float(counts), _angle(degrees, correction)] for counts, degrees in table]


def _moved_pair(point: Any, pair: Sequence[str], corrections: Mapping[str, JointCorrection]) -> list[Any]:
    counts, first, second = point
    return [list(counts), _angle(first, corrections.get(pair[0])), _angle(second, corrections.get(pair[1]))]


def _angle(degrees: float, correction: JointCorrection | None) -> float:
    return float(degrees) if correction is None else correction.gain * float(degrees) + correction.shift_deg
