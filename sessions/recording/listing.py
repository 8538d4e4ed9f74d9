"""Finds sessions and summarizes them, including damaged ones."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from drivers.core.errors import ConfigurationError, SessionError
from drivers.core.reading.bounded_files import refuse_unreachable
from sessions.recording.manifest import MANIFEST
from sessions.recording.session import TRAFFIC, Session
from sessions.recording.session_ids import LAST, recovered_id
from sessions.recording.traffic.mcap_frames import ends_well
from sessions.recording.traffic.reader import segment_paths

_STARTED = re.compile(r"\d{8}-\d{6}")
"""How the name of a recorded session begins; later ones sort behind earlier ones."""
_STARTED_DIGITS = 15


@dataclass(frozen=True)
class SessionSummary:
    """One line of a list of sessions.

    Attributes:
        status: that of the manifest, where ``open`` means that it is being recorded; or ``damaged``: left open by a
            crash, truncated, or not readable.
        grasps: number of grasps, if the session was closed.
        traffic_bytes: size of the traffic file, 0 if there is none.
        data_loss: whether the manifest lists losses.
        problem: why it cannot be read, why it failed, or how to repair it; otherwise empty.
        readable: whether its manifest can be read.
        left_open: whether a crash ended it.
        derived: how it was made from another session (``piece``, ``import``, ``recovered``); empty for a recording.
        recorded_here: whether it is a recording or the recovery of one, and can be the last one.
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
    readable: bool = True
    left_open: bool = False
    derived: tuple[str, ...] = ()
    recorded_here: bool = True


def summarize(folder: Path) -> SessionSummary:
    """Summary of a session folder; an unreadable manifest is reported, not raised."""
    traffic = folder / TRAFFIC
    size = sum(path.stat().st_size for path in segment_paths(traffic) if path.is_file())
    try:
        session = Session.open(folder)
    except SessionError as error:
        return SessionSummary(folder.name, folder, "damaged", traffic_bytes=size, problem=str(error), readable=False)
    manifest, damage = session.manifest, _damage(session)
    return SessionSummary(
        name=manifest.name,
        folder=folder,
        status="damaged" if damage else manifest.status,
        rig=manifest.rig,
        object_name=manifest.object_name,
        started_utc=manifest.started_utc,
        grasps=manifest.counts.get("grasps"),
        traffic_bytes=size,
        data_loss=bool(manifest.data_loss),
        problem=damage or manifest.problem,
        left_open=manifest.status == "open" and not session.being_recorded,
        derived=tuple(step.how for step in manifest.derived),
        recorded_here=manifest.recorded_here,
    )


def _damage(session: Session) -> str:
    """What is wrong with a recording, judged by its end; empty if nothing is."""
    advice = f"tactile-lab session recover {session.folder}"
    if session.manifest.status == "open":
        return "" if session.being_recorded else f"left open by a crash. Recover it: {advice}"
    if session.manifest.status == "failed":  # told by its own problem
        return ""
    last = segment_paths(session.folder / TRAFFIC)[-1]
    if not last.is_file():
        return f"{last.name} is missing"
    return "" if ends_well(last) else f"{last.name} is truncated. Recover what is readable: {advice}"


def left_open(root: Path) -> list[SessionSummary]:
    """The sessions under ``root`` that a crash left open, without those that were already recovered."""
    try:
        found = list_sessions(root)
    except ConfigurationError:
        return []  # whoever wants to write there is told why that is not possible
    names = {item.folder.name for item in found}
    return [item for item in found if item.left_open and recovered_id(item.folder.name) not in names]


def list_sessions(root: Path) -> list[SessionSummary]:
    """All sessions directly under ``root``, by time of recording, oldest first; none if the folder does not exist.

    Derived sessions follow their recording.

    Raises:
        ConfigurationError: ``root`` is not a readable folder.
    """
    if not root.exists():
        return []
    try:
        folders = sorted(entry for entry in root.iterdir() if _is_session(entry))
    except OSError as error:
        hint = "Name a folder of sessions"
        raise ConfigurationError(f"cannot be read ({error.strerror})", where=str(root), hint=hint) from error
    return sorted(map(summarize, folders), key=lambda item: (item.started_utc, len(item.derived), item.name))


def _is_session(folder: Path) -> bool:
    """Whether it is a session's folder; one that the user may not look into hides no others."""
    try:
        return (folder / MANIFEST).is_file() or (folder / TRAFFIC).is_file()
    except PermissionError:
        return False


def find_session(root: Path, name: str) -> Session:
    """A session by its folder's path, by its name under ``root``, or ``last``.

    ``last`` is the session whose recording under ``root`` began last, or its recovery if it is damaged. Extracts and
    imports are ignored: they carry the time of an earlier recording or of another clock, and their name is known to the
    person who made them.

    Raises:
        ConfigurationError: there is none.
        SessionError: its manifest cannot be read.
    """
    return Session.open(session_folder(root, name))


def session_folder(root: Path, name: str) -> Path:
    """The folder of a session, which may be damaged; named as for :func:`find_session`.

    Raises:
        ConfigurationError: there is none, or it is not certain which is the last.
    """
    if name == LAST:
        return _last_recorded(root)
    for path in (root / name, Path(name)):
        refuse_unreachable(path)
    folder = root / name if (root / name).is_dir() else Path(name)
    if folder.is_file() and _is_session(folder.parent):
        hint = f"Name the folder: {folder.parent}"
        raise ConfigurationError("is a file of a session", where=name, hint=hint)
    if not folder.is_dir():
        raise ConfigurationError("no such session", where=name, hint=f"See: tactile-lab session list --root {root}")
    if not any((folder / name).is_file() for name in (MANIFEST, TRAFFIC)):
        raise ConfigurationError(f"not a session folder (no {MANIFEST})", where=str(folder), hint="Check the path")
    return folder


def _refuse_hidden(last: SessionSummary, unreadable: list[SessionSummary]) -> None:
    """An older session must not count as the last one if a later one, by its name, cannot be read. Raises
    ConfigurationError.
    """
    for item in unreadable:
        if _STARTED.match(item.folder.name) and item.folder.name[:_STARTED_DIGITS] > last.folder.name:
            hint = f"Give a name, or recover it: tactile-lab session recover {item.folder}"
            what = f"is the last session, and cannot be read ({item.problem})"
            raise ConfigurationError(what, where=str(item.folder), hint=hint)


def _last_recorded(root: Path) -> Path:
    found = list_sessions(root)
    readable = [item for item in found if item.readable]
    recorded = [item for item in readable if item.recorded_here]
    if any(item.folder.name == LAST for item in found):
        hint = f"'last' means the newest session; give a path: {root / LAST}"
        raise ConfigurationError("is the name of a session here", where=LAST, hint=hint)
    if recorded:
        known = {item.folder.name for item in readable}
        hidden = [item for item in found if not item.readable and recovered_id(item.folder.name) not in known]
        _refuse_hidden(recorded[-1], hidden)
        return recorded[-1].folder
    if readable:
        names = ", ".join(item.folder.name for item in readable[-3:])
        hint = f"'last' ignores extracts and imports; give a name: {names}"
        what = "no session was recorded here, there are only extracts and imports"
        raise ConfigurationError(what, where=str(root), hint=hint)
    raise ConfigurationError("no session yet", where=str(root), hint="Record one first: tactile-lab run")
