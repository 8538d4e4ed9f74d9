"""Decides whether a session may start with its calibrations: present, unchanged, passed, valid, and of this rig."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from calibration.store.store import CalibrationRecord, read_record
from drivers.core.calibration_file import is_stored
from drivers.core.configuration import load
from drivers.core.errors import ConfigurationError

DEVICE_TABLES = frozenset({"joints", "motors", "markers", "boards", "rates", "gains", "geometry", "block", "board"})
"""Roles that may be plain files: the manufacturer's tables of a device, and descriptions of a rig's parts."""

UNCALIBRATED = "uncalibrated"
"""Key of a session's settings that records overridden objections."""

_CLOCK_SLACK_s = 86400.0


@dataclass(frozen=True)
class Installation:
    """The installation that a calibration must belong to.

    Attributes:
        rig: name of the installation (in the rig file).
        devices: known serial numbers by device name.
    """

    rig: str
    devices: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Objection:
    """The objection to one file.

    Attributes:
        role: of the file in the rig.
        file: its path.
        reason: one clause.
        hint: what to do.
    """

    role: str
    file: str
    reason: str
    hint: str

    def __str__(self) -> str:
        return f"{self.role} calibration {self.file} {self.reason}"


def objections(files: Mapping[str, Path], here: Installation, now: datetime | None = None) -> tuple[Objection, ...]:
    """All objections to starting a session with these files.

    Args:
        files: role to file.
        here: the installation.
        now: time; the computer's when None.
    """
    now = now or datetime.now(UTC)
    found = [_objection(role, path, here, now) for role, path in files.items()]
    return tuple(objection for objection in found if objection is not None)


def admit(
    files: Mapping[str, Path], here: Installation, *, allow_uncalibrated: bool = False, now: datetime | None = None
) -> tuple[str, ...]:
    """Refuse invalid files, or return the objections if the caller allows them.

    Returns:
        The objections as text, for the session's record; empty if there are none.

    Raises:
        ConfigurationError: there are objections, and they are not allowed.
    """
    against = objections(files, here, now)
    if against and not allow_uncalibrated:
        hint = f"{against[0].hint}, or run with --allow-uncalibrated, which the session records"
        raise ConfigurationError("; ".join(map(str, against)), where=f"rig {here.rig}", hint=hint)
    return tuple(map(str, against))


def check_record(record: CalibrationRecord, here: Installation, now: datetime) -> tuple[str, str] | None:
    """The objection to a record here and now, and what to do; None if it is valid."""
    if (foreign := _foreign(record, here)) is not None:
        return foreign
    if record.is_expired(now):
        return f"is valid until {record.valid_until_utc}", f"Calibrate again: tactile-lab calibrate {_command(record)}"
    if record.valid_until_utc is not None and (record.created - now).total_seconds() > _CLOCK_SLACK_s:
        return f"was created in the future, {record.created_utc}", "Set the computer's clock"
    if record.verdict != "PASS":
        return "did not pass its limits", f"Calibrate again: tactile-lab calibrate {_command(record)}"
    return None


def refuse_foreign(path: Path, here: Installation) -> None:
    """Refuse a stored calibration of another rig or device; plain files do not say whose they are.

    For evaluating old recordings, where it does not matter whether the calibration is still valid today.

    Raises:
        ConfigurationError: it is foreign, was changed by hand, or cannot be read.
    """
    if is_stored(load(path)) and (foreign := _foreign(read_record(path), here)) is not None:
        what, hint = foreign
        raise ConfigurationError(what, where=str(path), hint=hint)


def _foreign(record: CalibrationRecord, here: Installation) -> tuple[str, str] | None:
    """The objection if a record belongs to another rig or device, and what to do; otherwise None."""
    if record.rig != here.rig:
        return f"belongs to rig {record.rig}, not to {here.rig}", f"Use a calibration of {here.rig}"
    for device, serial in record.devices.items():
        if here.devices.get(device, serial) != serial:
            reason = f"belongs to the {device} with serial number {serial}, not {here.devices[device]}"
            return reason, f"Calibrate with the present {device}"
    return None


def _command(record: CalibrationRecord) -> str:
    return {"fingertips": "fingertip", "biotacs": "fingertip", "normals": "biotac"}.get(record.kind, record.kind)


def _objection(role: str, path: Path, here: Installation, now: datetime) -> Objection | None:
    try:
        if role in DEVICE_TABLES and not is_stored(load(path)):
            return None
        record = read_record(path)
    except ConfigurationError as error:
        return Objection(role, str(path), error.what, error.hint)
    kinds = {"fingertips": ("fingertips", "biotacs")}.get(role, (role,))
    if record.kind not in kinds:
        return Objection(role, str(path), f"is a calibration of {record.kind}", f"Use a calibration of {role}")
    refusal = check_record(record, here, now)
    return None if refusal is None else Objection(role, str(path), *refusal)
