"""The session folder: settings, calibration, and everything that was recorded.

::

    20261121-093000-sim-box/
        session.yaml        written first (status open), closed last
        calibration/        copies of the calibration files used
        traffic.mcap        bytes, session events, samples, truth; a long one continues in traffic-2.mcap
        truth/object.ply    the object's true mesh, for evaluation only
        results/            results computed from it
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from drivers.core.atomic_files import disk_full
from drivers.core.errors import ConfigurationError, SessionDataError, SessionError, WriteError
from drivers.core.reading.bounded_files import LARGEST_TABLE_bytes, read_bounded
from sessions.recording.manifest import (
    MANIFEST,
    Manifest,
    read_manifest,
)
from sessions.recording.session_ids import LONGEST_ID
from sessions.recording.traffic.disk import being_written
from sessions.recording.traffic.reader import TrafficReader

TRAFFIC, CALIBRATION, RESULTS, TRUTH_MESH = "traffic.mcap", "calibration", "results", "truth/object.ply"

TRAJECTORY = "trajectory.csv"
"""The file that identifies a results folder."""


class Session:
    """A session folder, new or existing."""

    def __init__(self, folder: Path, manifest: Manifest) -> None:
        self.folder, self.manifest = folder, manifest

    @classmethod
    def open(cls, folder: Path) -> Session:
        """Open an existing session.

        Raises:
            SessionError: not a session folder, or its ``session.yaml`` is invalid.
        """
        return cls(folder, read_manifest(folder))

    @property
    def results(self) -> Path:
        """Folder of results; created if missing. Raises SessionError."""
        folder = self.folder / RESULTS
        try:
            folder.mkdir(exist_ok=True)
        except OSError as error:
            hint = "Move the file that is in its place"
            raise SessionError(f"cannot be made ({error.strerror})", where=str(folder), hint=hint) from error
        return folder

    @property
    def truth_mesh(self) -> Path | None:
        """The object's true mesh, if the session has one; for evaluation only."""
        path = self.folder / TRUTH_MESH
        return path if path.is_file() else None

    def calibration_file(self, role: str) -> Path:
        """The copy of a calibration file, checked against its hash.

        Raises:
            SessionError: there is none for that role, or it is missing or was changed.
        """
        if role not in self.manifest.calibration:
            raise SessionDataError(f"no calibration called {role!r}", where=str(self.folder / MANIFEST))
        copy = self.manifest.calibration[role]
        path = self.folder / CALIBRATION / copy.file
        if (self.folder / TRAFFIC).is_file():
            hint = f"tactile-lab session recover {self.folder} takes it from the recording"
        else:
            hint = f"{TRAFFIC}, which holds a copy, is missing too: restore both from a copy of the session"
        if sha256(read_calibration(path, hint)) != copy.sha256:
            raise SessionDataError("changed since the recording", where=str(path), hint=hint)
        return path

    def is_calibrated_as_recorded(self) -> bool:
        """Whether all its calibration files are as they were."""
        try:
            for role in self.manifest.calibration:
                self.calibration_file(role)
        except SessionDataError:
            return False
        return True

    @property
    def being_recorded(self) -> bool:
        """Whether a running program is recording into it."""
        return self.manifest.status == "open" and being_written(self.folder / TRAFFIC)

    def traffic(self) -> TrafficReader:
        """The recorded traffic. Raises SessionError."""
        return TrafficReader(self.folder / TRAFFIC)


def new_folder(root: Path, name: str) -> Path:
    """Create a folder with that name, or with a number added if it exists.

    Raises:
        ConfigurationError: no folder can be made there.
        WriteError: the disk is full.
        SessionError: there are too many of that name.
    """
    try:
        root.mkdir(parents=True, exist_ok=True)
        for attempt in range(1, 1000):
            end = "" if attempt == 1 else f"-{attempt}"
            folder = root / (name[: LONGEST_ID - len(end)].rstrip("-_") + end)
            try:
                folder.mkdir()
            except FileExistsError:
                continue
            return folder
    except OSError as error:
        if disk_full(error):
            raise WriteError("the disk is full", where=str(root), hint="Free some space on it") from error
        in_the_way = isinstance(error, (FileExistsError, NotADirectoryError))
        what = "is not a folder" if in_the_way else f"cannot be made ({error.strerror})"
        raise ConfigurationError(what, where=str(root), hint="Choose another folder") from error
    raise SessionError("a thousand sessions with this time exist already", where=str(root / name))


def read_calibration(path: Path, hint: str = "") -> bytes:
    """The bytes of a calibration file. Raises SessionError."""
    try:
        return read_bounded(path, LARGEST_TABLE_bytes)
    except OSError as error:
        raise SessionDataError(f"cannot be read ({error.strerror})", where=str(path), hint=hint) from error
    except ConfigurationError as error:
        raise SessionDataError(error.what, where=str(path), hint=hint) from error


def sha256(content: bytes) -> str:
    """By which a file is known again."""
    return hashlib.sha256(content).hexdigest()
