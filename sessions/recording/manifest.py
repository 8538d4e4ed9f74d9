"""``session.yaml``: what was done, with what, and how it ended."""

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
from drivers.core.errors import ConfigurationError, SessionError
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
    """A step by which a session was made of another one.

    Attributes:
        how: recovered after an accident, a piece cut out, or brought in from an archive.
        source: name of the other session, or of the archive's file.
        made_utc: when, ISO 8601; what was recorded keeps the time at which it was.
    """

    how: Making
    source: str
    made_utc: str

    @property
    def words(self) -> str:
        """For people."""
        told = {"recovered": "recovered from", "piece": "a piece of", "import": "imported from"}
        return f"{told[self.how]} {self.source}, {self.made_utc}"


class Manifest(StrictModel):
    """What ``session.yaml`` says.

    Attributes:
        status: open while it runs; closed when it ended well; interrupted by a person; failed by an error; recovered
            when an open one was closed later.
        rig, rig_description: the rig's name and its complete description.
        object_name: what lay on the table.
        calibration: copies of the files used, by their role.
        versions, seeds, settings: what a repetition needs.
        notes: the operator's.
        started_utc, ended_utc: ISO 8601, of the recording.
        derived: how it was made of a recorded one, oldest step first; empty for what was recorded.
        counts: messages by topic, grasps and the like.
        streams: for each topic the messages recorded, gaps, late and dropped ones.
        data_loss: what was not recorded or dropped, by kind; empty when nothing was lost.
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
        """Whether it is a recording, or one's recovery, and neither a piece of one nor brought in from elsewhere."""
        return all(step.how == "recovered" for step in self.derived)

    def derivation(self, how: Making, source: str) -> tuple[Derivation, ...]:
        """``derived`` of what is made of this session now."""
        return (*self.derived, Derivation(how=how, source=source, made_utc=utc_text(datetime.now(UTC))))


def read_manifest(folder: Path) -> Manifest:
    """Read ``session.yaml`` of a session folder.

    Raises:
        SessionError: there is none, it is not a strict document of this form, or a newer version wrote it.
    """
    if not (folder / MANIFEST).is_file():
        raise SessionError("not a session folder (no session.yaml)", where=str(folder), hint="Check the path")
    where = str(folder / MANIFEST)
    try:
        return _validate(load(folder / MANIFEST), where)
    except ConfigurationError as error:
        raise SessionError(error.what, where=error.where, hint="The other files of the session are kept") from error


def manifest_from(content: bytes, where: str) -> Manifest:
    """A ``session.yaml`` that is no file of its own. Raises SessionError as :func:`read_manifest`."""
    try:
        return _validate(loads(content, where), where)
    except ConfigurationError as error:
        raise SessionError(error.what, where=error.where) from error


def _validate(content: Any, where: str) -> Manifest:
    return validate(converted_manifest(content, where), Manifest, where=where)


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Write ``session.yaml`` so that at any moment either the old or the new one is there, whole.

    Raises:
        SessionError: it holds something YAML has no word for.
        WriteError: it cannot be written.
    """
    try:
        text = yaml.dump(manifest.model_dump(), Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=120)
    except yaml.YAMLError as error:
        raise SessionError(f"cannot be put into YAML ({error})", where=str(folder / MANIFEST)) from error
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
    """Quotes every text that a strict reader could take for a number; repeats instead of aliases."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    style = '"' if text[:1] in tuple("0123456789+-.") else "|" if "\n" in text else None
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


_Dumper.add_representer(str, _text)
