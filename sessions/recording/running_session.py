"""A session that is being recorded: created before anything moves, closed whatever happens."""

from __future__ import annotations

import re
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from drivers.core.atomic_files import write_whole
from drivers.core.clock import utc_text
from drivers.core.errors import SessionError, TactileLabError
from sessions.recording.deferred_interruption import interruption_deferred
from sessions.recording.manifest import (
    MANIFEST,
    CalibrationCopy,
    Manifest,
    Status,
    installed_versions,
    write_manifest,
)
from sessions.recording.recorder import Recorder
from sessions.recording.session import (
    CALIBRATION,
    RESULTS,
    TRAFFIC,
    TRUTH_MESH,
    Session,
    new_folder,
    read_calibration,
    sha256,
)
from sessions.recording.session_ids import slug
from sessions.recording.traffic.raw_frames import Stamper
from sessions.recording.traffic.settings import Attached, TrafficSettings
from sessions.recording.traffic.writer import TrafficWriter


class RunningSession(Session):
    """A session that is being recorded; a context manager that closes it with the right status: ``closed`` normally,
    ``interrupted`` after a keyboard interrupt, ``failed`` after another exception.
    """

    def __init__(
        self,
        folder: Path,
        manifest: Manifest,
        stampers: Mapping[str, Stamper] | None = None,
        traffic_settings: TrafficSettings | None = None,
    ) -> None:
        super().__init__(folder, manifest)
        self._traffic = TrafficWriter(
            folder / TRAFFIC,
            {"session": manifest.name, "rig": manifest.rig},
            attachments=_attachments(folder, manifest),
            stampers=stampers,
            settings=traffic_settings,
        )
        self.recorder = Recorder(self._traffic)

    @property
    def traffic_sink(self) -> TrafficWriter:
        """The file its recorder writes to."""
        return self._traffic

    def settle(self) -> None:
        """Wait until everything queued for the disk is written, or writing has failed."""
        self._traffic.settle()

    def close(
        self,
        status: Status = "closed",
        *,
        counts: Mapping[str, int] | None = None,
        data_loss: Mapping[str, int] | None = None,
        problem: str = "",
        now: datetime | None = None,
    ) -> None:
        """Finish the traffic file and ``session.yaml``; idempotent, the first call counts.

        A Ctrl+C meanwhile waits until both are finished: a session that had ended would be left open otherwise.

        Args:
            counts: counts besides those of the messages (grasps, cycles, overruns).
            data_loss: undecodable messages and so on; zeros are left out. Losses known to the recorder (gaps, late and
                dropped messages) are added.

        Raises:
            WriteError: the folder cannot be written.
            SessionError: it is not there any more.
            KeyboardInterrupt: see above.
        """
        if self.manifest.status != "open":
            return
        with interruption_deferred():
            self._close(status, counts or {}, data_loss or {}, problem, now)

    def _close(
        self,
        status: Status,
        counts: Mapping[str, int],
        data_loss: Mapping[str, int],
        problem: str,
        now: datetime | None,
    ) -> None:
        known = {kind: str(number) for kind, number in {**counts, **data_loss}.items()}
        try:
            self._traffic.close({"status": status, "problem": problem, **known})
        except SessionError as error:
            status, problem = "failed", problem or str(error)
        streams = self._traffic.streams
        lost = {**data_loss, **streams.losses(), "traffic_cut_short": int(not self._traffic.complete)}
        self.manifest = self.manifest.model_copy(
            update={
                "status": status,
                "ended_utc": utc_text(now or datetime.now(UTC)),
                "counts": {**dict(sorted(streams.messages.items())), **counts},
                "streams": streams.plain(),
                "data_loss": {kind: number for kind, number in lost.items() if number},
                "problem": problem,
            }
        )
        if not self._traffic.path.is_file():
            what = "was removed or renamed while it was recorded"
            renamed = self.folder.with_name("NEW-NAME")
            hint = f"If it was renamed, recover it by its new name: tactile-lab session recover {renamed}"
            raise SessionError(what, where=str(self.folder), hint=hint)
        write_manifest(self.folder, self.manifest)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        elif isinstance(error, KeyboardInterrupt):
            self.close("interrupted")
        else:
            self.close("failed", problem=_in_words(error))


def _in_words(error: BaseException) -> str:
    """Why a session failed, for people who read it later: "1" or nothing would help nobody."""
    if isinstance(error, TactileLabError):
        return str(error)
    if isinstance(error, SystemExit):
        return f"the program was ended with exit code {error.code}"
    if isinstance(error, MemoryError):
        return "the memory was exhausted"
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


def create_session(
    root: Path,
    *,
    rig: str,
    rig_description: Mapping[str, Any],
    object_name: str,
    calibration_files: Mapping[str, Path] | None = None,
    seeds: Mapping[str, int] | None = None,
    settings: Mapping[str, Any] | None = None,
    notes: str = "",
    truth_mesh_ply: bytes | None = None,
    started: datetime | None = None,
    stampers: Mapping[str, Stamper] | None = None,
    traffic_settings: TrafficSettings | None = None,
) -> RunningSession:
    """Create a new session folder under ``root`` and begin recording.

    Args:
        rig_description, settings: plain data (what a YAML file can hold).
        calibration_files: role to file; copied with their hashes.
        truth_mesh_ply: the true mesh as PLY bytes, if the rig knows it.
        started: start time, UTC; default: now.
        stampers: by transport, the reader of the device's own counter and clock.
        traffic_settings: how the recording is stored; the defaults suit a rig whose time waits for the disk.

    Raises:
        ConfigurationError: the folder cannot be created.
        SessionError: a calibration file cannot be read.
        WriteError: the folder cannot be written.
    """
    started = started or datetime.now(UTC)
    folder = new_folder(root, f"{started:%Y%m%d-%H%M%S}-{slug(rig)}-{slug(object_name)}")
    manifest = Manifest(
        name=folder.name,
        status="open",
        rig=rig,
        rig_description=dict(rig_description),
        object_name=object_name,
        calibration=_copy_calibration(folder, calibration_files or {}),
        versions=installed_versions(),
        seeds=dict(seeds or {}),
        settings=dict(settings or {}),
        notes=notes,
        started_utc=utc_text(started),
    )
    write_manifest(folder, manifest)
    (folder / RESULTS).mkdir()
    if truth_mesh_ply is not None:
        (folder / TRUTH_MESH).parent.mkdir()
        write_whole(folder / TRUTH_MESH, truth_mesh_ply)
    return RunningSession(folder, manifest, stampers, traffic_settings)


def _attachments(folder: Path, manifest: Manifest) -> tuple[Attached, ...]:
    """Files stored inside the recording, so that it can be read without the folder."""
    names = [CALIBRATION + "/" + copy.file for copy in manifest.calibration.values()]
    return tuple(Attached(name, "application/yaml", read_calibration(folder / name)) for name in (MANIFEST, *names))


def _copy_calibration(folder: Path, files: Mapping[str, Path]) -> dict[str, CalibrationCopy]:
    (folder / CALIBRATION).mkdir()
    copies = {}
    for role, source in files.items():
        content = read_calibration(source)
        name = re.sub(r"[^A-Za-z0-9]+", "-", role).strip("-") + source.suffix
        write_whole(folder / CALIBRATION / name, content)
        copies[role] = CalibrationCopy(file=name, sha256=sha256(content))
    return copies
