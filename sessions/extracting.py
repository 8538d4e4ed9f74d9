"""A piece of a session as a session of its own: some links, some seconds; for tests, and for showing others."""

from __future__ import annotations

import shutil
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from sessions import schemas
from sessions.manifest import write_manifest
from sessions.session import CALIBRATION, TRAFFIC, Session
from sessions.session_ids import check_id
from sessions.traffic import TrafficWriter
from sessions.traffic_reader import TrafficReader
from sessions.traffic_settings import Attached, TrafficSettings
from tactile_lab.clock import NANOSECONDS
from tactile_lab.errors import ConfigurationError, SessionError


@dataclass(frozen=True)
class Piece:
    """What is to be cut out.

    Attributes:
        from_s, to_s: seconds since the session's first message; None for its beginning and end.
        links: names of the links whose bytes are kept; None for all.
        samples: keep what viewers show (samples, events, estimates, truth) too; the bytes say all of it again.
        attachments: keep the calibration inside the recording too, and not only beside it.
    """

    from_s: float | None = None
    to_s: float | None = None
    links: Collection[str] | None = None
    samples: bool = False
    attachments: bool = True


def extract(session: Session, into: Path, piece: Piece) -> dict[str, int]:
    """Cut a piece out of a session, into a new folder; gives the number of messages by topic.

    Marks are kept, so that the piece can be understood as far as it goes.

    Raises:
        SessionError: the recording can not be read, the folder exists, or nothing is in the piece.
        ConfigurationError: a link that the recording does not have.
    """
    check_id(into.name, str(into))
    try:
        into.mkdir(parents=True)
    except OSError as error:
        what = "exists already" if isinstance(error, FileExistsError) else f"can not be made ({error.strerror})"
        raise SessionError(what, where=str(into), hint="Choose another folder") from error
    try:
        counts = _copy_traffic(session.traffic(), into, session.manifest.name, piece)
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
        settings=TrafficSettings(tell_streams=False),
    )
    links, first_ns = set[str](), None
    try:
        for message in reader.messages():
            first_ns = message.stamp_ns if first_ns is None else first_ns
            if schemas.is_raw(message.topic):
                links.add(schemas.link_of(message.topic))
            if _wanted(message.topic, (message.stamp_ns - first_ns) / NANOSECONDS, piece):
                writer.write(message.topic, message.data, message.stamp_ns, message.device)
    finally:
        writer.close({"extracted_from": source})
    _check(piece, links, writer.streams.messages, str(reader.path))
    return dict(sorted(writer.streams.messages.items()))


def _wanted(topic: str, at_s: float, piece: Piece) -> bool:
    if (piece.from_s is not None and at_s < piece.from_s) or (piece.to_s is not None and at_s >= piece.to_s):
        return False
    if schemas.is_raw(topic):
        return piece.links is None or schemas.link_of(topic) in piece.links
    return piece.samples or topic == schemas.MARKS_TOPIC


def _check(piece: Piece, links: Collection[str], counts: Mapping[str, int], where: str) -> None:
    if unknown := set(piece.links or ()) - set(links):
        hint = f"Its links are {', '.join(sorted(links))}"
        raise ConfigurationError(f"no link called {', '.join(sorted(unknown))}", where=where, hint=hint)
    if not any(counts.values()):
        raise SessionError("nothing was recorded in that piece", where=where, hint="Choose other seconds or links")


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
