"""The bytes of a recording, and what is read of it whole, cut off anywhere, or with wrong bytes: as before."""

from __future__ import annotations

import hashlib
import io
import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gtsam import Pose3, Rot3
from mcap.opcode import Opcode

from drivers.core.contacts import Contact, Grasp, StepSigma
from drivers.core.errors import TactileLabError
from sessions.recording import device_stamps
from sessions.recording.recorder import Level, NullRecorder, Recorder
from sessions.recording.session_events import EventKind, SessionEvent
from sessions.recording.traffic import raw_frames, schemas
from sessions.recording.traffic.files import END_RECORD, FORMAT, PROFILE, sealed, segment_path
from sessions.recording.traffic.formats import converted_manifest, traffic_converter
from sessions.recording.traffic.loss import Loss
from sessions.recording.traffic.mcap_frames import Frames, ends_well
from sessions.recording.traffic.mcap_summary import read_summary
from sessions.recording.traffic.mcap_writer import McapWriter
from sessions.recording.traffic.raw_frames import DeviceStamp
from sessions.recording.traffic.reader import TrafficReader, may_hold, segment_paths
from sessions.recording.traffic.session_clock import SessionClock
from sessions.recording.traffic.stream_counts import StreamCounts
from tests.support.baseline import assert_baseline
from tests.support.told_session import Kept, told

TOPICS = ("/link/hand/rx", "/link/hand/tx", "/link/ft/FF/rx", "/marks")
STEP_ns = 3_000_000


def recording(count: int = 120, first: int = 0, number: int = 1) -> bytes:
    """A whole recording in chunks of some twenty messages, with a stored file and its notes at both ends."""
    out, random = io.BytesIO(), np.random.default_rng(number)
    writer = McapWriter(out, 900, PROFILE, "a library")
    info = sealed({"session": "s", "segment": str(number), "format": FORMAT})
    writer.add_metadata(PROFILE, info)
    writer.add_attachment("calibration/joints.yaml", "application/yaml", b"a: 1\n" * 20)
    writer.add_metadata(PROFILE, info)
    schema = writer.add_schema(raw_frames.SCHEMA_NAME, raw_frames.SCHEMA_ENCODING, raw_frames.DEFINITION.encode())
    channels = [writer.add_channel(topic, raw_frames.MESSAGE_ENCODING, schema) for topic in TOPICS]
    for at in range(first, first + count):
        stamp_ns, data = STEP_ns * at, at.to_bytes(4, "little") + random.bytes(20)
        topic = at % len(TOPICS)
        device = DeviceStamp(at // 4, stamp_ns + 7) if topic == 2 else DeviceStamp()
        content = SessionEvent(EventKind.UNDO, stamp_ns).to_bytes() if topic == 3 else b""
        writer.add_message(
            channels[topic], stamp_ns, content or raw_frames.encode(data, stamp_ns, device), stamp_ns, at
        )
    writer.add_closing_metadata(END_RECORD, {"status": "closed", "streams": '{"/marks": {"late": 1}}'})
    writer.finish()
    return out.getvalue()


@pytest.fixture(scope="module")
def whole() -> bytes:
    return recording()


def read(path: Path) -> list[Any]:
    """What is told of a recording, and a checksum of all that was read."""
    try:
        reader = TrafficReader(path)
        found = list(reader.messages())
    except TactileLabError as error:
        return [str(error).replace(str(path.parent), "")]
    what = [(message.topic, message.data, message.stamp_ns, message.sequence, message.device) for message in found]
    loss = reader.loss
    return [
        *(len(found), hashlib.sha256(repr(what).encode()).hexdigest()[:12]),
        *(loss.counts(), dict(sorted(loss.by_topic.items())), loss.describe(), sorted(reader.end), sorted(reader.info)),
    ]


def test_the_bytes_and_records_of_a_recording(whole: bytes, tmp_path: Path) -> None:
    frames = Frames(io.BytesIO(whole))
    records = [[Opcode(opcode).name, len(content)] for opcode, content in frames]
    summary = read_summary(io.BytesIO(whole))
    path = tmp_path / "traffic.mcap"
    path.write_bytes(whole)
    assert_baseline(
        "sessions/recording/bytes",
        {
            "sha256": hashlib.sha256(whole).hexdigest(),
            "records": records,
            "complete": [frames.complete, frames.unreadable_bytes, frames.damaged_magic],
            "summary": [dict(summary.topics), dict(summary.counts), summary.landmarks],
            "read": read(path),
            "streams": TrafficReader(path).streams(),
            "files": [[one.name, one.media_type, len(one.data)] for one in TrafficReader(path).attachments()],
            "on": {topic: sum(1 for _ in TrafficReader(path).messages_on({topic})) for topic in TOPICS},
            "may hold": [may_hold(path, {topic}) for topic in (*TOPICS, "/events")],
            "ends well": ends_well(path),
        },
    )


def test_a_recording_that_is_cut_off(whole: bytes, tmp_path: Path) -> None:
    """Anywhere, and one byte before, at and behind the borders of its records."""
    borders, start = [], 8
    for _, content in Frames(io.BytesIO(whole)):
        start += 9 + len(content)
        borders += [start - 1, start, start + 1]
    path, told = tmp_path / "traffic.mcap", {}
    for at in sorted({*range(0, len(whole), len(whole) // 40), *borders[::2]}):
        path.write_bytes(whole[:at])
        told[str(at)] = [*read(path), ends_well(path)]
    assert_baseline("sessions/recording/cut", told)


def test_a_recording_with_wrong_bytes(whole: bytes, tmp_path: Path) -> None:
    """One byte, eight zeros, or a hole; in what ended well, and in what did not."""
    path, told = tmp_path / "traffic.mcap", {}
    for ended, content in {"whole": whole, "cut": whole[: len(whole) * 3 // 5]}.items():
        for at in range(0, len(content), len(content) // 60):
            path.write_bytes(content[:at] + bytes([content[at] ^ 0x11]) + content[at + 1 :])
            told[f"{ended}, byte {at}"] = read(path)
        for at in range(5, len(content) - 8, len(content) // 15):
            path.write_bytes(content[:at] + bytes(8) + content[at + 8 :])
            told[f"{ended}, zeros {at}"] = read(path)
            path.write_bytes(content[:at] + content[at + 40 :])
            told[f"{ended}, hole {at}"] = read(path)
    assert_baseline("sessions/recording/damaged", told)


def test_wherever_a_recording_was_cut_it_may_hold_anything(whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "traffic.mcap"
    for length in (*range(8), *range(len(whole) - 300, len(whole) - 1)):  # inside numbers of records, too
        path.write_bytes(whole[:length])
        assert may_hold(path, {"/events"})


def test_a_recording_in_several_files(tmp_path: Path) -> None:
    """All there, the second missing, in the wrong place, or none but the first whole."""
    path = tmp_path / "traffic.mcap"
    parts = {number: recording(40, 40 * (number - 1), number) for number in (1, 2, 3)}
    for number, content in parts.items():
        segment_path(path, number).write_bytes(content)
    (tmp_path / "traffic-0.mcap").write_bytes(b"no part of it")
    told = {"all": [read(path), [each.name for each in segment_paths(path)]]}
    segment_path(path, 3).write_bytes(parts[3][: len(parts[3]) // 2])
    told["last cut"] = [read(path), may_hold(path, {"/events"})]
    segment_path(path, 2).unlink()
    told["second missing"] = [read(path), [each.name for each in segment_paths(path)]]
    assert_baseline("sessions/recording/files", told)


def test_every_message_of_the_recorder() -> None:
    """All kinds, with what their topics' schemas are called; some values are no numbers."""
    kept, onlooker = Kept(), Kept()
    recorder = Recorder(kept)
    recorder.add_onlooker(onlooker)
    pose = Pose3(Rot3.Ypr(0.3, -0.2, 0.1), np.array([0.1, 0.2, 0.3]))
    touch = Contact("FF", np.array([0.1, 0.0, 0.2]), np.array([0.0, 0.6, 0.8]), np.diag([1e-6, 2e-6, 3e-6]), 0.1, 0.5)
    recorder.on_transmitted("hand", b"demand", 1)
    recorder.on_received("ft/FF", b"reading", 2)
    recorder.event(SessionEvent(EventKind.TARE, 3, ("FF", "TH")))
    recorder.frames(4, {"palm": pose})
    recorder.grasp(5, Grasp(1, 5, (touch,), motion_sigma=StepSigma(0.001, 0.02)), {"TH": "no contact"})
    recorder.biotac(6, "FF", {"PDC": 1, "E1": None}, [1, 2])
    recorder.guide(7, {"pose": np.array([1.0, np.nan, np.inf])})
    recorder.safety_stop(8, "too hard", [{"stamp_ns": 7}])
    recorder.camera(9, np.eye(3), (0.1,) * 8, (64, 48))
    recorder.slam(10, None, {"index": 0, "values": [float("nan"), np.float64(2.0)]})
    recorder.truth(11, pose, [touch])
    recorder.log(12, Level.ERROR, "hand", "hot")
    recorder.image(13, b"\x89PNG")
    recorder.image(14, b"\xff\xd8")
    due = [recorder.state_due(now_ns) for now_ns in (0, 79_999_999, 80_000_000, 100_000_000, 160_000_000)]
    NullRecorder().log(1, Level.INFO, "nobody", "hears")
    written = [[topic, _content(topic, data), stamp_ns] for topic, data, stamp_ns in (*kept.messages, *told())]
    named = {topic: _named(topic) for topic in {message[0] for message in written}}
    assert_baseline(
        "sessions/recording/messages",
        {
            "written": written,
            "heard": [topic for topic, _, _ in onlooker.messages],
            "due": [*due, NullRecorder().state_due(0)],
            "schemas": dict(sorted(named.items())),
        },
    )


def _content(topic: str, data: bytes) -> Any:
    return data.hex() if schemas.is_raw(topic) else json.loads(data)


def _named(topic: str) -> list[Any]:
    schema = schemas.SCHEMAS.get(topic) or schemas.schema_by_form(topic)
    return [schema and schema.name, schema and json.loads(schema.to_bytes()), schemas.stamper_of(topic)]


def test_gaps_late_messages_and_jumps_of_clocks() -> None:
    ms = 1_000_000
    sequence: tuple[tuple[str, int, DeviceStamp], ...] = (
        ("/link/hand/rx", 0, DeviceStamp(5)),
        ("/link/hand/rx", 10, DeviceStamp(6)),
        ("/link/ft/FF/rx", 12, DeviceStamp(100, None, 7)),
        ("/link/ft/FF/rx", 20, DeviceStamp(107, None, 7)),
        ("/link/ft/FF/rx", 30, DeviceStamp(116)),
        ("/link/hand/rx", 40, DeviceStamp(3)),
        ("/link/hand/rx", 50, DeviceStamp(4)),
        ("/link/hand/tx", 550, DeviceStamp()),
        ("/link/hand/rx", 450, DeviceStamp(5)),
        ("/link/hand/rx", 449, DeviceStamp(6)),
        ("/link/ft/FF/rx", 1050, DeviceStamp(117)),
        ("/link/ft/FF/rx", 1551, DeviceStamp(118)),
        ("/link/hand/rx", 1560, DeviceStamp(9)),
        ("/camera/image", 1400, DeviceStamp()),
        ("/recorder/streams", 0, DeviceStamp()),
        ("/events", 1000, DeviceStamp()),
    )
    counts, clock, told = StreamCounts(), SessionClock(), list[Any]()
    for topic, at_ms, device in sequence:
        counts.take(topic, at_ms * ms, device)
        if (transport := schemas.received_transport(topic)) is not None:
            clock.on_received(transport, at_ms * ms)
        else:
            clock.on_stamp(at_ms * ms)
        told.append([counts.now_ns, clock.now_ns, clock.ahead_ns()])
    counts.dropped["/events"] += 2
    counts.unwritten["/marks"] += 1
    assert_baseline("sessions/recording/streams", {"times": told, "losses": counts.losses(), "plain": counts.plain()})


def test_stamps_of_devices_and_envelopes() -> None:
    rdt, positioner = bytes(range(1, 37)), bytes(range(1, 53))
    stamps = {
        "rdt": [device_stamps.rdt_stamp(payload) for payload in (rdt, 3 * rdt, rdt[:-1], b"")],
        "positioner": [
            device_stamps.positioner_stamp(payload) for payload in (positioner, positioner[:-1], 2 * positioner)
        ],
        "camera": [device_stamps.camera_stamp(payload) for payload in (b"", b"\xff\xd8", b"TLC1" + bytes(60))],
    }
    told: dict[str, Any] = {kind: [list(vars(stamp).values()) for stamp in found] for kind, found in stamps.items()}
    told["names"] = sorted(device_stamps.STAMPERS)
    for name, stamp_ns in {"first": 0, "second": 1_000_000_000, "late": 3 << 61}.items():
        frame = raw_frames.encode(b"payload", stamp_ns, DeviceStamp(7, None if name == "first" else 9))
        payload, device = raw_frames.decode(frame)
        told[name] = [frame.hex(), payload.decode(), list(vars(device).values())]
    for name, data in {
        "short": frame[:31],
        "torn": frame[:-1],
        "longer": frame + b"x",
        "other": b"\1" + frame[1:],
    }.items():
        with pytest.raises(ValueError, match="raw frame") as refused:
            raw_frames.decode(data)
        told[name] = str(refused.value)
    assert_baseline("sessions/recording/stamps", told)


def test_versions_of_formats() -> None:
    told: dict[str, Any] = {}
    forms = (
        *("tactile-traffic/1", "tactile-traffic/2", "tactile-traffic/3", "tactile-traffic/0"),
        "other/9",
        None,
        "tactile-traffic/x",
    )
    for form in forms:
        try:
            convert = traffic_converter(form, "a file")
            told[str(form)] = [str(convert((topic, b"bytes", 5))) for topic in ("/link/hand/rx", "/events")]
        except TactileLabError as error:
            told[str(form)] = str(error)
    for number in range(5):
        try:
            told[f"manifest {number}"] = converted_manifest(
                {"format": f"tactile-session/{number}", "name": "x"}, "a file"
            )
        except TactileLabError as error:
            told[f"manifest {number}"] = str(error)
    told["no manifest"] = [converted_manifest([1], "a file"), converted_manifest({"name": "x"}, "a file")]
    assert_baseline("sessions/recording/formats", told)


def test_words_of_losses() -> None:
    losses = [
        *(Loss(), Loss(truncated=True), Loss(truncated=True, unreadable_bytes=7), Loss(damaged_chunks=1)),
        *(Loss(damaged_chunks=2, missing_messages=5), Loss(damaged_files=1, missing_messages=1)),
        Loss(damaged_records=3, unreadable_bytes=70, damaged_files=2),
    ]
    told = [[loss.describe(), loss.counts(), bool(loss)] for loss in losses]
    assert_baseline("sessions/recording/losses", {"told": told, "kinds": Counter(bool(loss) for loss in losses)[True]})
