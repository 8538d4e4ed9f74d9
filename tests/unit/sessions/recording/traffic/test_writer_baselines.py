"""Recordings as they are written, message by message: files, counts, ends, tails and what stops them; as before."""

from __future__ import annotations

import errno
import struct
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from drivers.core.errors import SessionError
from sessions.recording.traffic import tail, writer
from sessions.recording.traffic.disk import CutBackFile, being_written
from sessions.recording.traffic.files import disk_failure, is_sealed, sealed
from sessions.recording.traffic.raw_frames import DeviceStamp
from sessions.recording.traffic.reader import TrafficReader, segment_paths
from sessions.recording.traffic.settings import Attached, TrafficSettings
from sessions.recording.traffic.tail import Tail, TailMessage, read_tail
from sessions.recording.traffic.writer import TrafficWriter
from tests.support.baseline import assert_baseline
from tests.support.said import said


@pytest.fixture(autouse=True)
def same_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a machine of any speed, by a program of any version."""
    monkeypatch.setattr(TrafficWriter, "_flush_in_time", lambda self: None)
    monkeypatch.setattr(writer, "version", lambda name: "1.0.0")


def numbered(payload: bytes) -> DeviceStamp:
    """As of a device that numbers its messages."""
    return DeviceStamp(struct.unpack("<I", payload[:4])[0])


def written(path: Path, settings: TrafficSettings, count: int = 40) -> TrafficWriter:
    """A recording of four seconds; every tenth message of the fingertip is missing, and the camera's come late."""
    attached = (Attached("a.yaml", "application/yaml", b"a: 1\n"),)
    stampers = {"ft/FF": numbered}
    made = TrafficWriter(path, {"session": "s"}, attachments=attached, stampers=stampers, settings=settings)
    try:
        for n in range(count):
            _write(made, n)
    except BaseException:
        with suppress(SessionError):
            made.close()
        raise
    return made


def _write(into: TrafficWriter, n: int) -> None:
    stamp_ns = 1_000_000_000 + 100_000_000 * n
    into.write("/link/hand/rx", bytes([n]) * 30, stamp_ns)
    into.write("/link/hand/tx", b"demand", stamp_ns + 1)
    if n % 10 != 3:
        into.write("/link/ft/FF/rx", struct.pack("<I", n) + bytes([n]) * 9, stamp_ns + 2)
    if n % 7 == 0:
        into.write("/link/camera/rx", bytes(5), stamp_ns - 150_000_000)
    into.flush()


def contents(path: Path) -> dict[str, Any]:
    """What is read of it, file by file and together."""
    reader = TrafficReader(path)
    messages = list(reader.messages())
    alone = {each.name: sum(1 for _ in TrafficReader(each).messages()) for each in segment_paths(path)[1:]}
    topics = sorted({message.topic for message in messages})
    return {
        "messages": {topic: sum(message.topic == topic for message in messages) for topic in topics},
        "alone": alone,
        "end": {key: value for key, value in reader.end.items() if key != "streams"},
        "streams": reader.streams(),
        "info": {key: value for key, value in reader.info.items() if key != "library"},
        "told": [message.data.decode() for message in messages if message.topic == "/recorder/streams"],
        "numbers": [message.sequence for message in messages[::17]],
        "devices": [message.device.counter for message in messages if message.topic == "/link/ft/FF/rx"][::5],
        "loss": reader.loss.counts(),
    }


def test_files_of_a_recording(tmp_path: Path) -> None:
    told: dict[str, Any] = {}
    kinds = {
        "one file": TrafficSettings(tail=False),
        "several files": TrafficSettings(segment_bytes=6000, tail=False),
        "a copy": TrafficSettings(tell_streams=False, tail=False),
    }
    for name, settings in kinds.items():
        path = tmp_path / name / "traffic.mcap"
        path.parent.mkdir()
        made = written(path, settings)
        open_now = being_written(path)
        made.close({"status": "closed"})
        made.close({"status": "closed again"})
        told[name] = contents(path) | {"losses": made.streams.losses(), "complete": made.complete}
        told[name]["open"] = [open_now, being_written(path), being_written(tmp_path)]
        told[name]["files"] = sorted(each.name for each in path.parent.iterdir())
    told["exists"] = said(lambda: TrafficWriter(path), tmp_path)
    told["no folder"] = said(lambda: TrafficWriter(tmp_path / "none" / "traffic.mcap"), tmp_path)
    assert_baseline("sessions/recording/writer", told)


class BadDisk(CutBackFile):
    """Takes so many bytes, and then says that it is full, or broken."""

    room, code = 5000, errno.ENOSPC

    def write(self, data: bytes) -> int:
        if self.tell() + len(data) > self.room:
            raise OSError(self.code, "as the system says it")
        return super().write(data)


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EIO])
def test_a_disk_that_takes_no_more(code: int, tmp_path: Path) -> None:
    class Disk(BadDisk):
        pass

    Disk.code = code
    path = tmp_path / "traffic.mcap"
    told: dict[str, Any] = {
        "written": said(lambda: written(path, TrafficSettings(open_file=Disk, tail=False)), tmp_path)
    }
    reader = TrafficReader(path)
    told["read"] = [sum(1 for _ in reader.messages()), reader.loss.counts()]
    Disk.room = 100
    begun = tmp_path / "begun.mcap"
    told["begun"] = said(lambda: TrafficWriter(begun, settings=TrafficSettings(open_file=Disk, tail=False)), tmp_path)
    assert_baseline(f"sessions/recording/disk_{errno.errorcode[code]}", told)


def test_words_for_a_failing_disk_and_seals() -> None:
    path = Path("traffic.mcap")
    errors: list[OSError | SessionError] = [
        OSError(errno.ENOSPC, "full"),
        OSError(errno.EIO, "broken"),
        SessionError("own"),
    ]
    told: dict[str, Any] = {"words": [str(disk_failure(path, error, 70)) for error in errors]}
    note = sealed({"b": "1", "a": "2"})
    told["sealed"] = [note, is_sealed(note), is_sealed({**note, "a": "3"}), is_sealed({"a": "2"})]
    assert_baseline("sessions/recording/disk_words", told)


def test_a_file_is_cut_back_to_what_was_complete(tmp_path: Path) -> None:
    file = CutBackFile(tmp_path / "file")
    sizes = [file.write(b"12345"), file.tell(), file.kept]
    file.keep()
    sizes += [file.write(b"678"), file.tell(), file.kept]
    file.sync()
    file.cut_back()
    assert sizes == [5, 5, 0, 3, 8, 5]
    assert (tmp_path / "file").read_bytes() == b"12345"
    assert being_written(tmp_path / "file")
    file.close()
    assert not being_written(tmp_path / "file")


def test_tails_that_are_overwritten_and_damaged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shared = tmp_path / "shared"
    shared.mkdir()
    monkeypatch.setattr(tail, "_SHARED", shared)
    told: dict[str, Any] = {}
    for size in (400, 401, 1000):
        path = tmp_path / f"{size}.mcap"
        ring = Tail(path, size)
        for n in range(23):
            ring.append(TailMessage("/a" if n % 2 else "/topic", n, 10 * n, 10 * n - 5, bytes([n]) * (n % 5 * 9)))
        ring.append(TailMessage("/large", 99, 0, 0, bytes(size)))
        told[f"of {size}"] = _numbers(path)
        place = path.with_suffix(".tail").readlink()
        whole = place.read_bytes()
        changes: dict[str, Callable[[], bytes]] = {
            "one byte": lambda whole=whole: whole[:4200] + bytes([whole[4200] ^ 1]) + whole[4201:],
            "cut": lambda whole=whole: whole[:4350],
            "head only": lambda whole=whole: whole[:4096],
            "a mark more": lambda whole=whole: whole[:4300] + b"\x1dtail\xa1" + whole[4306:],
        }
        for name, change in changes.items():
            place.write_bytes(change())
            told[f"of {size}, {name}"] = _numbers(path)
        place.write_bytes(whole)
        ring.close(complete=size == 400)
        told[f"of {size}, closed"] = [path.with_suffix(".tail").is_symlink(), place.is_file()]
    elsewhere = tmp_path / "elsewhere.mcap"
    elsewhere.with_suffix(".tail").symlink_to(tmp_path / "tactile-lab-x.tail")
    (tmp_path / "tactile-lab-x.tail").write_bytes(whole)
    told["elsewhere"] = _numbers(elsewhere)
    assert_baseline("sessions/recording/tails", told)


def _numbers(path: Path) -> list[Any]:
    return [[each.topic, each.sequence, each.log_ns, each.stamp_ns, len(each.data)] for each in read_tail(path)]
