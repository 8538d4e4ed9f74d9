"""Recovers a session after a crash.

A recording that is truncated or has damaged parts is read as far as possible and written into a new session folder. The
damaged session is never changed. Losses are reported by topic: messages in damaged parts are known from their index; of
the last moments only a bound is known, a tenth of a second.
"""

from __future__ import annotations

import shutil
from collections import Counter, deque
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from drivers.core.atomic_files import write_whole, writing_into
from drivers.core.clock import NANOSECONDS
from drivers.core.errors import SessionDataError, SessionError
from sessions.recording.manifest import MANIFEST, Manifest, manifest_from, read_manifest, write_manifest
from sessions.recording.session import CALIBRATION, RESULTS, TRAFFIC, TRAJECTORY, Session, new_folder
from sessions.recording.session_ids import recovered_id
from sessions.recording.traffic.disk import being_written
from sessions.recording.traffic.loss import Loss
from sessions.recording.traffic.reader import TrafficMessage, TrafficReader
from sessions.recording.traffic.settings import Attached, TrafficSettings
from sessions.recording.traffic.writer import TrafficWriter

LAST_MOMENTS_s = 0.1
"""Longest time before a crash whose messages may not have reached the file."""


@dataclass(frozen=True)
class TopicRecovery:
    """Recovery of one topic.

    Attributes:
        read: messages recovered.
        lost: messages known to be lost.
        at_most_more: further messages of the last moments that may be lost, by the previous rate.
        last_s: stamp of the last recovered message, session clock, seconds.
    """

    read: int
    lost: int
    at_most_more: int
    last_s: float


@dataclass(frozen=True)
class Recovery:
    """Recovery of a session.

    Attributes:
        source: the folder that was recovered.
        folder: the new session; None if the old one was complete.
        topics: by topic.
        loss: what could not be read.
        left_out: results folders of the old session, by name, which are not copied: they belong to another recording
            than the new one.
        calibrations_lost: files of calibrations that are damaged or missing both in the folder and in the recording.
    """

    source: Path
    folder: Path | None
    topics: dict[str, TopicRecovery]
    loss: Loss
    left_out: tuple[str, ...] = ()
    calibrations_lost: tuple[str, ...] = ()

    @property
    def lossy(self) -> bool:
        """Whether anything was lost."""
        return bool(self.loss or self.calibrations_lost)

    def describe(self) -> str:
        """What was lost in words; empty if nothing was."""
        lost = [f"no sound copy of {name}" for name in self.calibrations_lost]
        return "; ".join(filter(None, (self.loss.describe(), *lost)))


def recover(source: Path, root: Path | None = None) -> Recovery:
    """Recover a damaged session.

    Args:
        source: its folder.
        root: folder for the new session; by default that of the old one.

    Raises:
        SessionError: it is being recorded, is not a session, contains nothing readable, or the new folder cannot be
            created.
        WriteError: the new folder cannot be written.
    """
    if being_written(source / TRAFFIC):
        raise SessionDataError("is being recorded", where=str(source), hint="Wait until the session has ended")
    reader = TrafficReader(source / TRAFFIC)
    manifest = _manifest(source, reader)
    sound = manifest.status not in ("open", "failed") and Session(source, manifest).is_calibrated_as_recorded()
    if sound and not _read_through(reader):
        return Recovery(source, None, {}, reader.loss)
    folder = new_folder(root or source.parent, recovered_id(source.name))
    try:
        return _recover_into(folder, source, manifest, reader)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)  # nothing but what this function has put there
        raise


def _recover_into(folder: Path, source: Path, manifest: Manifest, reader: TrafficReader) -> Recovery:
    calibrations = _calibrations(source, manifest, reader)
    with writing_into(folder):
        _copy_files(source, folder, calibrations)
    written, topics = _copy_traffic(reader, folder, _stored_files(source, reader, calibrations))
    if not written:
        raise SessionDataError("contains no readable message", where=str(reader.path), hint="Nothing can be recovered")
    _count_again(folder, written)
    lost = tuple(copy.file for copy in manifest.calibration.values() if copy.file not in calibrations)
    recovery = Recovery(source, folder, topics, reader.loss, _result_folders(source), lost)
    write_manifest(folder, _recovered_manifest(manifest, folder, written, recovery))
    return recovery


def _manifest(source: Path, reader: TrafficReader) -> Manifest:
    """The session's manifest from the folder, or if that cannot be read from the recording."""
    try:
        return read_manifest(source)
    except SessionError:
        for attachment in reader.attachments():
            if attachment.name == MANIFEST:
                return manifest_from(attachment.data, f"{MANIFEST} inside {reader.path}")
        raise


def _read_through(reader: TrafficReader) -> bool:
    """Read everything once. Returns whether anything is lost."""
    deque(reader.messages(), maxlen=0)
    return bool(reader.loss)


def _calibrations(source: Path, manifest: Manifest, reader: TrafficReader) -> dict[str, bytes]:
    """Calibration files as they were when the session began, by name: the recording's, or else the folder's copies."""
    parts = [(*one.name.rpartition("/"), one.data) for one in reader.attachments()]
    stored = {name: content for kept, _, name, content in parts if kept == CALIBRATION}
    for role, copy in manifest.calibration.items():
        if copy.file not in stored:
            with suppress(SessionDataError):
                stored[copy.file] = Session(source, manifest).calibration_file(role).read_bytes()
    return stored


def _stored_files(source: Path, reader: TrafficReader, calibrations: dict[str, bytes]) -> tuple[Attached, ...]:
    """What the new recording stores: the description as it was when the session began, or else as it is now."""
    told = [one.data for one in reader.attachments() if one.name == MANIFEST] or [(source / MANIFEST).read_bytes()]
    files = {MANIFEST: told[0], **{f"{CALIBRATION}/{name}": content for name, content in calibrations.items()}}
    return tuple(Attached(name, "application/yaml", content) for name, content in files.items())


def _copy_files(source: Path, folder: Path, calibrations: dict[str, bytes]) -> None:
    """Copy all files but recording, manifest, results, links, pipes and devices; calibrations are the recording's."""
    for item in sorted(source.iterdir()):
        if _is_special(item) or item.name == MANIFEST or item.suffix in (".mcap", ".part") or _holds_results(item):
            continue
        if item.is_dir():
            copied = folder / item.name
            shutil.copytree(item, copied, symlinks=True, ignore=_left_out, copy_function=_copy_file)
        else:
            shutil.copyfile(item, folder / item.name)
    (folder / CALIBRATION).mkdir(exist_ok=True)
    for name, content in calibrations.items():
        write_whole(folder / CALIBRATION / name, content)


def _copy_file(source: str, copy: str) -> None:
    """Ends the copying of a whole folder at the first file that cannot be copied. Raises WriteError."""
    with writing_into(Path(copy)):
        shutil.copyfile(source, copy)


def _holds_results(item: Path) -> bool:
    return item.name == RESULTS or (item / TRAJECTORY).is_file()


def _left_out(folder: str, names: list[str]) -> list[str]:
    items = [Path(folder) / name for name in names]
    return [item.name for item in items if _holds_results(item) or (_is_special(item) and not item.is_symlink())]


def _is_special(item: Path) -> bool:
    return item.is_symlink() or not (item.is_file() or item.is_dir())


def _result_folders(source: Path) -> tuple[str, ...]:
    """All results folders in a session."""
    return tuple(sorted(path.parent.relative_to(source).as_posix() for path in source.rglob(TRAJECTORY)))


def _copy_traffic(
    reader: TrafficReader, folder: Path, attached: tuple[Attached, ...]
) -> tuple[Counter[str], dict[str, TopicRecovery]]:
    info = {key: value for key, value in reader.info.items() if key not in ("format", "segment")}
    settings = TrafficSettings(tell_streams=False, tail=False)
    writer = TrafficWriter(folder / TRAFFIC, info, attachments=attached, settings=settings)
    rates = _Rates()
    try:
        for message in rates.watch(reader.messages()):
            writer.write(message.topic, message.data, message.stamp_ns, message.device)
    finally:
        writer.close({"recovered": "yes", "lost": reader.loss.describe()})
    return writer.streams.messages, rates.topics(reader.loss)


class _Rates:
    """How many messages each topic had, and how many in its last second."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._recent: dict[str, deque[int]] = {}
        self._newest_ns = 0

    def watch(self, messages: Iterator[TrafficMessage]) -> Iterator[TrafficMessage]:
        """Count messages while passing them on."""
        for message in messages:
            self._counts[message.topic] += 1
            self._newest_ns = max(self._newest_ns, message.stamp_ns)
            recent = self._recent.setdefault(message.topic, deque(maxlen=20_000))
            recent.append(message.stamp_ns)
            while recent[0] < message.stamp_ns - NANOSECONDS:
                recent.popleft()
            yield message

    def topics(self, loss: Loss) -> dict[str, TopicRecovery]:
        """The recovery of each topic."""
        since_ns = self._newest_ns - NANOSECONDS
        found = {}
        for topic in sorted(self._counts | Counter(loss.by_topic)):
            recent = self._recent.get(topic, deque())
            per_second = sum(stamp_ns > since_ns for stamp_ns in recent)
            last_moments = -(-per_second // round(1 / LAST_MOMENTS_s)) if loss.truncated else 0
            last_s = recent[-1] / NANOSECONDS if recent else 0.0
            found[topic] = TopicRecovery(self._counts[topic], loss.by_topic.get(topic, 0), last_moments, last_s)
        return found


def _count_again(folder: Path, written: Counter[str]) -> None:
    """Open the new recording and compare. Raises SessionError."""
    reader = TrafficReader(folder / TRAFFIC)
    found = Counter(message.topic for message in reader.messages())
    if found != written or reader.loss:
        what = f"was written, but only {sum(found.values())} of {sum(written.values())} messages can be read back"
        raise SessionError(what, where=str(reader.path), hint="Check the disk, then recover again")


def _recovered_manifest(manifest: Manifest, folder: Path, written: Counter[str], recovery: Recovery) -> Manifest:
    lost = {f"lost {topic}": item.lost for topic, item in recovery.topics.items() if item.lost}
    described = recovery.describe()
    return manifest.model_copy(
        update={
            "name": folder.name,
            "status": "recovered",
            "ended_utc": manifest.ended_utc,
            "counts": {**manifest.counts, **dict(sorted(written.items()))},
            "data_loss": {**manifest.data_loss, **recovery.loss.counts(), **lost},
            "derived": manifest.derivation("recovered", recovery.source.name),
            "problem": f"recovered with loss: {described}" if described else "",
        }
    )
