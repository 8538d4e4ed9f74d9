"""Finding sessions and telling what is in them, broken ones included."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from sessions.manifest import MANIFEST
from sessions.session import TRAFFIC, Session
from tactile_lab.errors import SessionError


@dataclass(frozen=True)
class SessionSummary:
    """One line of a list of sessions.

    Attributes:
        status: that of the manifest, or ``unreadable``.
        grasps: number of grasps, when the session was closed.
        traffic_bytes: size of the traffic file, 0 when there is none.
        data_loss: something was lost, by the manifest.
        problem: why it can not be read or why it failed; else empty.
    """

    name: str
    folder: Path
    status: str
    rig: str = ""
    object_name: str = ""
    started_utc: str = ""
    grasps: int | None = None
    traffic_bytes: int = 0
    data_loss: bool = False
    problem: str = ""


def summarize(folder: Path) -> SessionSummary:
    """What a session folder holds; a manifest that can not be read is told, not raised."""
    traffic = folder / TRAFFIC
    size = traffic.stat().st_size if traffic.is_file() else 0
    try:
        manifest = Session.open(folder).manifest
    except SessionError as error:
        return SessionSummary(folder.name, folder, "unreadable", traffic_bytes=size, problem=str(error))
    return SessionSummary(
        name=manifest.name,
        folder=folder,
        status=manifest.status,
        rig=manifest.rig,
        object_name=manifest.object_name,
        started_utc=manifest.started_utc,
        grasps=manifest.counts.get("grasps"),
        traffic_bytes=size,
        data_loss=bool(manifest.data_loss),
        problem=manifest.problem,
    )


def list_sessions(root: Path) -> list[SessionSummary]:
    """All sessions directly under ``root``, oldest first; none when there is no such folder.

    Raises:
        SessionError: ``root`` is not a folder that can be read.
    """
    if not root.exists():
        return []
    try:
        folders = sorted(
            entry for entry in root.iterdir() if (entry / MANIFEST).is_file() or (entry / TRAFFIC).is_file()
        )
    except OSError as error:
        raise SessionError(f"can not be read ({error.strerror})", where=str(root)) from error
    return sorted((summarize(folder) for folder in folders), key=lambda item: (item.started_utc, item.name))


def find_session(root: Path, name: str) -> Session:
    """A session by its folder's path, by its name under ``root``, or ``last`` for the newest.

    Raises:
        SessionError: there is none, or its manifest can not be read.
    """
    if name == "last":
        readable = [item for item in list_sessions(root) if item.status != "unreadable"]
        if not readable:
            raise SessionError("no session yet", where=str(root), hint="Record one first: tactile-lab run")
        return Session.open(readable[-1].folder)
    folder = root / name if (root / name).is_dir() else Path(name)
    if not folder.is_dir():
        raise SessionError("no such session", where=name, hint=f"See: tactile-lab session list --root {root}")
    return Session.open(folder)
