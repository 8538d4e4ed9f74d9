"""Sessions at addresses such as ``s3://bucket/laboratory``: stored, fetched back, and listed without their bytes."""

from __future__ import annotations

import shutil
from pathlib import Path

from drivers.core.atomic_files import refuse_existing, writing_into
from drivers.core.errors import ConfigurationError
from sessions.exchange.addresses import Place, checked_name
from sessions.recording.manifest import MANIFEST
from sessions.recording.session import Session
from sessions.recording.session_ids import check_id

EVALUATION = "results/evaluation.json"
_END_BYTES = 65_536
"""Of a recording, which show whether it is complete."""


def store_session(session: Session, address: str) -> str:
    """Copy a session below an address; what says that it is one is copied last, so that half a session is none.

    Returns:
        Its own address.

    Raises:
        ConfigurationError: it is being recorded, or there already; there is no such bucket.
        WriteError: one may not write there, or the connection fails. What was copied is removed again.
    """
    if session.being_recorded:
        raise ConfigurationError("is being recorded", where=str(session.folder), hint="Store it when it has ended")
    place = Place(f"{address.rstrip('/')}/{session.manifest.name}")
    if place.holds(MANIFEST):
        raise ConfigurationError("exists already", where=place.address, hint="Name another folder")
    files = [file for file in sorted(session.folder.rglob("*")) if file.is_file() and not file.is_symlink()]
    names = {file.relative_to(session.folder).as_posix(): file for file in files}
    put: list[str] = []
    try:
        for name in sorted(names, key=lambda one: one == MANIFEST):
            put.append(name)
            place.put(name, names[name])
    except BaseException:
        place.remove(put)
        raise
    return place.address


def fetch_session(address: str, root: Path) -> Session:
    """Copy a session from its address into a folder of sessions, completely or not at all.

    Raises:
        ConfigurationError: there is no session there, or one of its name here.
        SessionError: what is there is no valid session.
        WriteError: it cannot be read or written.
    """
    place, name = Place(address), address.rstrip("/").rpartition("/")[2]
    check_id(name)
    refuse_existing([root / name])
    files = place.names()
    if MANIFEST not in files:
        hint = "Name the address of a session, as 'tactile-lab session store' printed it"
        raise ConfigurationError("is no session", where=address, hint=hint)
    partial = root / f".{name}.part"
    try:
        with writing_into(partial):
            partial.mkdir(parents=True)
        for one in files:
            place.get(checked_name(one), partial / one)
        Session.open(partial)
        partial.rename(root / name)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return Session.open(root / name)


def list_elsewhere(address: str, into: Path) -> Path:
    """Make a folder in which sessions at an address can be listed and judged by their records.

    Of each session there are its record, its evaluation, and recordings of the right sizes that hold their ends alone.

    Args:
        address: of a folder of sessions.
        into: an empty folder.

    Returns:
        ``into``.

    Raises:
        ConfigurationError: there is no such bucket.
        WriteError: it cannot be read.
    """
    place = Place(address)
    files = place.names()
    for name, size in files.items():
        parts = checked_name(name).split("/")
        if len(parts) > 1 and f"{parts[0]}/{MANIFEST}" in files:
            _stand_in(place, name, size, into)
    return into


def _stand_in(place: Place, name: str, size: int, into: Path) -> None:
    """What is needed of one file."""
    inside = name.partition("/")[2]
    if inside in (MANIFEST, EVALUATION):
        place.get(name, into / name)
    elif "/" not in inside and inside.endswith(".mcap"):
        file = into / name
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("wb") as whole:  # with a hole: it takes no room
            whole.seek(max(0, size - _END_BYTES))
            whole.write(place.read(name, max(0, size - _END_BYTES)))
