"""Extracts part of a session (some transports, a time span) as a new session, for tests and for sharing."""

from __future__ import annotations

import shutil
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from drivers.core.atomic_files import writing_into
from drivers.core.clock import NANOSECONDS
from drivers.core.errors import ConfigurationError, WriteError
from sessions.recording.manifest import write_manifest
from sessions.recording.session import CALIBRATION, TRAFFIC, Session
from sessions.recording.session_ids import check_id
from sessions.recording.traffic import schemas
from sessions.recording.traffic.reader import TrafficReader
from sessions.recording.traffic.settings import Attached, TrafficSettings
from sessions.recording.traffic.writer import TrafficWriter


@dataclass(frozen=True)
class Piece:
    """What to extract.

    Attributes:
        from_s, to_s: seconds since the session's first message; None for its beginning and end.
        transports: names of the transports whose bytes are kept; None for all.
        samples: also keep the topics for viewers (samples, events, estimates, truth), which can be computed again from
        the bytes. attachments: keep the calibration inside the recording too, and not only next to it.
    """

    from_s: float | None = None
    to_s: float | None = None
    transports: Collection[str] | None = None
    samples: bool = False
    attachments: bool = True


def extract(session: Session, into: Path, piece: Piece) -> dict[str, int]:
    """Extract part of a session into a new folder.

    Returns the number of messages by topic. Session events are kept, so that the extract can be replayed.

    Raises:
        SessionError: the recording cannot be read.
        ConfigurationError: the folder exists, the recording does not have a transport, or the extract would be empty.
        WriteError: the folder cannot be made or written.
    """
    check_id(into.name, str(into))
    try:
        into.mkdir(parents=True)
    except OSError as error:
        if isinstance(error, FileExistsError):
            raise ConfigurationError("exists already", where=str(into), hint="Choose another folder") from error
        what = f"cannot be made ({error.strerror})"
        raise WriteError(what, where=str(into), hint="Choose another folder") from error
    try:
        counts = _copy_traffic(session.traffic(), into, session.manifest.name, piece)
        with writing_into(into):
            _copy_calibration(session, into)
        _write_manifest(session, into, counts)
    except BaseException:
        shutil.rmtree(into, ignore_errors=True)
        raise
    return counts


def _copy_traffic(reader: TrafficReader, into: Path, source: str, piece: Piece) -> dict[str, int]:
    attached = tuple(Attached(item.name, item.media_type, item.data) for item in reader.attachments())
    writer = TrafficWriter(
        into / TRAFFIC,
        {"session": into.name, "extracted_from": source},
        attachments=attached if piece.attachments else (),
        settings=TrafficSettings(tell_streams=False, tail=False),
    )
    transports, first_ns = set[str](), None
    try:
        for message in reader.messages():
            first_ns = message.stamp_ns if first_ns is None else first_ns
            if schemas.is_raw(message.topic):
                transports.add(schemas.link_of(message.topic))
            if _is_wanted(message.topic, (message.stamp_ns - first_ns) / NANOSECONDS, piece):
                writer.write(message.topic, message.data, message.stamp_ns, message.device)
    finally:
        writer.close({"extracted_from": source})
    _check(piece, transports, writer.streams.messages, str(reader.path))
    return dict(sorted(writer.streams.messages.items()))


def _is_wanted(topic: str, at_s: float, piece: Piece) -> bool:
    if (piece.from_s is not None and at_s < piece.from_s) or (piece.to_s is not None and at_s >= piece.to_s):
        return False
    if schemas.is_raw(topic):
        return piece.transports is None or schemas.link_of(topic) in piece.transports
    return piece.samples or topic == schemas.SESSION_EVENTS_TOPIC


def _check(piece: Piece, transports: Collection[str], counts: Mapping[str, int], where: str) -> None:
    if unknown := set(piece.transports or ()) - set(transports):
        hint = f"Its transports are {', '.join(sorted(transports))}"
        raise ConfigurationError(f"no transport called {', '.join(sorted(unknown))}", where=where, hint=hint)
    if not any(counts.values()):
        raise ConfigurationError(
            "nothing was recorded in that part", where=where, hint="Choose another time span or other transports"
        )


def _copy_calibration(session: Session, into: Path) -> None:
    (into / CALIBRATION).mkdir()
    for role, copy in session.manifest.calibration.items():
        shutil.copyfile(session.calibration_file(role), into / CALIBRATION / copy.file)


def _write_manifest(session: Session, into: Path, counts: Mapping[str, int]) -> None:
    changes = {
        "name": into.name,
        "status": "closed",
        "counts": dict(counts),
        "streams": {},
        "data_loss": {},
        "problem": "",
        "derived": session.manifest.derivation("piece", session.manifest.name),
    }
    write_manifest(into, session.manifest.model_copy(update=changes))
