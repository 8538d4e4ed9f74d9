"""The calibration store: one YAML file per result with its complete provenance.

Result and accuracy, data and method, date, devices and rig, and expiry. Written atomically; sealed with a hash of its
content (:mod:`drivers.core.calibration_file`).
"""

from __future__ import annotations

import platform
from collections.abc import Mapping
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Literal

import yaml
from pydantic import Field, field_validator

from drivers.core.atomic_files import write_whole
from drivers.core.calibration_file import SEAL, check_seal, is_stored, plain, seal_of
from drivers.core.clock import utc_text
from drivers.core.configuration import StrictModel, load, validate
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError

Kind = Literal["forearm", "joints", "fingertips", "biotacs", "normals", "camera"]
Verdict = Literal["PASS", "FAIL"]

VALID_DAYS = 90.0
"""Default validity of a result."""

_DISTRIBUTIONS = {
    "tactile-lab": "tactile-lab",
    "numpy": "numpy",
    "gtsam": "gtsam",
    "opencv": "opencv-contrib-python-headless",
}


class Covariance(StrictModel):
    """Covariance of a result.

    Attributes:
        of: names of its rows, with units.
        matrix: square, in the order of ``of``.
    """

    of: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]

    @field_validator("matrix")
    @classmethod
    def _square(cls, value: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
        if any(len(row) != len(value) for row in value):
            raise ValueError("the matrix is not square")
        return value

    @classmethod
    def from_matrix(cls, names: tuple[str, ...], matrix: Array) -> Covariance:
        """From an array, shape (n, n)."""
        return cls(of=names, matrix=tuple(tuple(map(float, row)) for row in matrix))


def _time(value: str) -> str:
    try:
        stamp = datetime.fromisoformat(value)
    except ValueError as error:
        raise ValueError("must be a time such as 2026-11-21T09:30:00+00:00") from error
    if stamp.tzinfo is None:
        raise ValueError("must include its time zone, for instance +00:00")
    return value


class CalibrationRecord(StrictModel):
    """One result.

    Attributes:
        kind: what was calibrated; the role of its file in a rig.
        rig: the installation it belongs to (in the rig file).
        devices: serial numbers of the devices it belongs to, by device name; empty if unknown.
        method: how it was found.
        created_utc, valid_until_utc: ISO 8601; None: no expiry.
        software: versions of the software.
        parameters: read by the device's loader.
        covariance: of the parameters or of what they were computed from; None if there is none.
        residuals: per pose and in total; values for people, by name.
        limits: of the verdict.
        verdict: whether the result is inside its limits.
        details: further findings (joint offsets, the marker's place on the hand, ...).
        notes: the operator's.
    """

    format: Literal["tactile-calibration/1"] = "tactile-calibration/1"
    kind: Kind
    rig: str = Field(min_length=1)
    devices: dict[str, str] = Field(default_factory=dict)
    method: str = Field(min_length=1)
    created_utc: str
    valid_until_utc: str | None = None
    software: dict[str, str] = Field(default_factory=dict)
    parameters: dict[str, Any]
    covariance: Covariance | None = None
    residuals: dict[str, Any] = Field(default_factory=dict)
    limits: dict[str, float] = Field(default_factory=dict)
    verdict: Verdict
    details: dict[str, Any] = Field(default_factory=dict)
    notes: str = ""

    _created = field_validator("created_utc")(_time)

    @field_validator("valid_until_utc")
    @classmethod
    def _end(cls, value: str | None) -> str | None:
        return None if value is None else _time(value)

    @property
    def created(self) -> datetime:
        """When it was made."""
        return datetime.fromisoformat(self.created_utc)

    def is_expired(self, now: datetime) -> bool:
        """Whether it has expired."""
        return self.valid_until_utc is not None and datetime.fromisoformat(self.valid_until_utc) < now


def new_record(
    kind: Kind,
    *,
    rig: str,
    method: str,
    parameters: StrictModel | Mapping[str, Any],
    verdict: Verdict,
    devices: Mapping[str, str] | None = None,
    covariance: Covariance | None = None,
    residuals: Mapping[str, Any] | None = None,
    limits: Mapping[str, float] | None = None,
    details: Mapping[str, Any] | None = None,
    notes: str = "",
    valid_days: float | None = VALID_DAYS,
    now: datetime | None = None,
) -> CalibrationRecord:
    """A record created now by this version of the program; without expiry if ``valid_days`` is None."""
    created = (now or datetime.now(UTC)).astimezone(UTC)
    until = None if valid_days is None else utc_text(created + timedelta(days=valid_days))
    return CalibrationRecord(
        kind=kind,
        rig=rig,
        devices=dict(devices or {}),
        method=method,
        created_utc=utc_text(created),
        valid_until_utc=until,
        software=software_versions(),
        parameters=plain(parameters) if isinstance(parameters, StrictModel) else dict(parameters),
        covariance=covariance,
        residuals=dict(residuals or {}),
        limits=dict(limits or {}),
        verdict=verdict,
        details=dict(details or {}),
        notes=notes,
    )


def target_file(out: Path, record: CalibrationRecord) -> Path:
    """Path of a record: its file, or NAME.failed.yaml if it failed, so that it replaces no valid one."""
    return out if record.verdict == "PASS" else out.with_name(f"{out.stem}.failed{out.suffix}")


def write_record(path: Path, record: CalibrationRecord, comment: str = "") -> None:
    """Write a sealed record atomically.

    Raises:
        WriteError: the file cannot be written.
    """
    head = "".join(f"# {line}\n" for line in comment.splitlines())
    write_whole(path, head + sealed_text(record), "Choose another file with --out")


def sealed_text(record: CalibrationRecord) -> str:
    """The record as YAML, with its seal at the end."""
    document = plain(record)
    document[SEAL] = seal_of(document)
    return yaml.dump(document, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=120)


def read_record(path: Path) -> CalibrationRecord:
    """Read a stored calibration.

    Raises:
        ConfigurationError: it is missing, is not a stored calibration, was changed by hand, or is invalid.
    """
    content = load(path)
    if not is_stored(content):
        hint = "Calibrate with tactile-lab calibrate: plain values do not say where they come from"
        raise ConfigurationError("is not a stored calibration", where=str(path), hint=hint)
    check_seal(content, str(path))
    del content[SEAL]
    return validate(content, CalibrationRecord, where=str(path))


def software_versions() -> dict[str, str]:
    """Versions of the software that computes a calibration."""
    versions = {"python": platform.python_version()}
    for name, distribution in _DISTRIBUTIONS.items():
        with suppress(PackageNotFoundError):
            versions[name] = version(distribution)
    return versions


class _Dumper(yaml.SafeDumper):
    """Short lists of numbers in one line; texts that look like numbers or words of YAML in quotes."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _list(dumper: yaml.SafeDumper, values: list[Any]) -> yaml.SequenceNode:
    flat = all(isinstance(value, (int, float)) for value in values)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", values, flow_style=flat)


def _text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    style = '"' if text[:1] in tuple("0123456789+-.") else "|" if "\n" in text else None
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


_Dumper.add_representer(list, _list)
_Dumper.add_representer(str, _text)
