"""``session.yaml``: devices, settings, and how the session ended."""

from __future__ import annotations

import platform
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Literal

import yaml
from pydantic import Field

from drivers.core.atomic_files import write_whole
from drivers.core.clock import utc_text
from drivers.core.configuration import StrictModel, load, loads, validate
from drivers.core.errors import ConfigurationError, SessionDataError, SessionError
from drivers.core.reading.bounded_files import refuse_unreachable
from sessions.recording.traffic.formats import converted_manifest

Status = Literal["open", "closed", "interrupted", "failed", "recovered"]
Making = Literal["recovered", "piece", "import"]

MANIFEST = "session.yaml"

_DISTRIBUTIONS = {
    "tactile-lab": "tactile-lab",
    "numpy": "numpy",
    "gtsam": "gtsam",
    "mujoco": "mujoco-core",
    "opencv": "opencv-contrib-python-headless",
}


class CalibrationCopy(StrictModel):
    """A calibration file's copy inside the session folder and its SHA-256."""

    file: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")
    sha256: str


class Derivation(StrictModel):
    """A step by which a session was derived from another one.

    Attributes:
        how: recovered after a crash, extracted, or imported from an archive.
        source: name of the other session, or of the archive's file.
        made_utc: time of this step, ISO 8601; the recording keeps its own times.
    """

    how: Making
    source: str
    made_utc: str

    @property
    def words(self) -> str:
        """The step as words for people."""
        told = {"recovered": "recovered from", "piece": "a piece of", "import": "imported from"}
        return f"{told[self.how]} {self.source}, {self.made_utc}"


class Manifest(StrictModel):
    """The content of ``session.yaml``.

    Attributes:
        status: open while it runs; closed if it ended normally; interrupted by a person; failed with an error;
            recovered if an open one was closed later.
        rig, rig_description: the rig's name and its complete description.
        object_name: the object on the table.
        calibration: copies of the files used, by their role.
        versions, seeds, settings: needed to repeat it.
        notes: the operator's.
        started_utc, ended_utc: ISO 8601, of the recording.
        derived: how it was derived from a recording, oldest step first; empty for a recording.
        counts: messages by topic, number of grasps and so on.
        streams: for each topic the messages recorded, gaps, late and dropped ones.
        data_loss: lost or dropped data, by kind; empty if nothing was lost.
        problem: why it failed.
    """

    format: Literal["tactile-session/3"] = "tactile-session/3"
    name: str
    status: Status
    rig: str
    rig_description: dict[str, Any]
    object_name: str
    calibration: dict[str, CalibrationCopy] = Field(default_factory=dict)
    versions: dict[str, str] = Field(default_factory=dict)
    seeds: dict[str, int] = Field(default_factory=dict)
    settings: dict[str, Any] = Field(default_factory=dict)
    notes: str = ""
    started_utc: str
    ended_utc: str | None = None
    derived: tuple[Derivation, ...] = ()
    counts: dict[str, int] = Field(default_factory=dict)
    streams: dict[str, dict[str, int]] = Field(default_factory=dict)
    data_loss: dict[str, int] = Field(default_factory=dict)
    problem: str = ""

    @property
    def recorded_here(self) -> bool:
        """Whether it is a recording or the recovery of one, and neither an extract nor an import."""
        return all(step.how == "recovered" for step in self.derived)

    def derivation(self, how: Making, source: str) -> tuple[Derivation, ...]:
        """The ``derived`` list of a session made from this one."""
        return (*self.derived, Derivation(how=how, source=source, made_utc=utc_text(datetime.now(UTC))))


def read_manifest(folder: Path) -> Manifest:
    """Read ``session.yaml`` of a session folder.

    Raises:
        SessionError: there is none, it is not a strict document of this form, or a newer version wrote it.
    """
    try:
        refuse_unreachable(folder / MANIFEST)
    except ConfigurationError as error:
        raise SessionDataError(error.what, where=error.where, hint=error.hint) from error
    if not (folder / MANIFEST).is_file():
        raise SessionDataError("not a session folder (no session.yaml)", where=str(folder), hint="Check the path")
    where = str(folder / MANIFEST)
    try:
        return _validate(load(folder / MANIFEST), where)
    except ConfigurationError as error:
        raise SessionDataError(error.what, where=error.where, hint="The session's other files are unchanged") from error


def manifest_from(content: bytes, where: str) -> Manifest:
    """Parse the text of a ``session.yaml``. Raises SessionError as :func:`read_manifest`."""
    try:
        return _validate(loads(content, where), where)
    except ConfigurationError as error:
        raise SessionDataError(error.what, where=error.where) from error


def _validate(content: Any, where: str) -> Manifest:
    return validate(converted_manifest(content, where), Manifest, where=where)


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Write ``session.yaml`` atomically: at any moment either the old or the new one exists completely.

    Raises:
        SessionError: it has a value that YAML cannot represent.
        WriteError: it cannot be written.
    """
    try:
        text = yaml.dump(manifest.model_dump(), Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=120)
    except yaml.YAMLError as error:
        raise SessionError(f"cannot be written as YAML ({error})", where=str(folder / MANIFEST)) from error
    write_whole(folder / MANIFEST, text)


def installed_versions() -> dict[str, str]:
    """Versions of Python and of the packages that results depend on."""
    versions = {"python": platform.python_version()}
    for name, distribution in _DISTRIBUTIONS.items():
        try:
            versions[name] = version(distribution)
        except PackageNotFoundError:
            versions[name] = "not installed"
    return versions


class _Dumper(yaml.SafeDumper):
    """Quotes every text that a strict reader could take for a number; writes repeated values instead of aliases."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    style = '"' if text[:1] in tuple("0123456789+-.") else "|" if "\n" in text else None
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


_Dumper.add_representer(str, _text)
