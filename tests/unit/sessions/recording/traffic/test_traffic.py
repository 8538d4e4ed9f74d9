from __future__ import annotations

import contextlib
import errno
import os
import struct

import pytest
import zstandard
from gtsam import Pose3
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from drivers.core.errors import SessionError
from sessions.recording.recorder import Level, NullRecorder, Recorder
from sessions.recording.session_events import EventKind, SessionEvent
from sessions.recording.traffic import disk as traffic_disk
from sessions.recording.traffic import raw_frames, schemas
from sessions.recording.traffic import writer as traffic
from sessions.recording.traffic.reader import TrafficReader
from sessions.recording.traffic.writer import TrafficWriter

STEP_ns = 10_000_000
QUICK = settings(max_examples=60, deadline=None, derandomize=True)


def record(path, count=200, size=100, *, close=True):
    """A file of numbered messages on a few topics, as a session's bytes come."""
    writer = TrafficWriter(path, {"session": "s"})
    for number in range(count):
        topic = ("/link/hand/rx", "/link/hand/tx", "/link/ft/FF/rx")[number % 3]
        writer.write(topic, number.to_bytes(4, "little") + os.urandom(size), number * STEP_ns // 3)
    if close:
        writer.close()
    return writer


def fill(writer, count):
    for number in range(count):
        writer.write("/link/hand/rx", number.to_bytes(4, "little") + os.urandom(100), number * STEP_ns)


def numbers(reader):
    found = [message for message in reader.messages() if message.topic.startswith("/link/")]
    return [int.from_bytes(message.data[:4], "little") for message in found]


def chunk_ends(content):
    """(end offset of each chunk, messages in it), by walking the records."""
    ends, position = [], 8
    while position < len(content) - 8:
        opcode, length = struct.unpack_from("<BQ", content, position)
        position += 9 + length
        if opcode == 6:
            ends.append(position)
    return ends


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("traffic") / "traffic.mcap"
    record(path)
    return path.read_bytes()


def test_messages_come_back_in_order_with_their_stamps(tmp_path):
    writer = TrafficWriter(tmp_path / "t.mcap", {"session": "name"})
    sent = [("/link/hand/rx", b"\0\1", 50), ("/link/hand/tx", b"", 40), ("/marks", b"{}", 40), ("/link/a/rx", b"x", 60)]
    for topic, data, stamp_ns in sent:
        writer.write(topic, data, stamp_ns)
    writer.close()
    writer.close()
    reader = TrafficReader(tmp_path / "t.mcap")
    assert [(m.topic, m.data, m.stamp_ns) for m in reader.messages()] == sent
    assert not reader.loss
    assert reader.loss.describe() == ""
    assert reader.info == {"session": "name", "format": "tactile-traffic/2", "segment": "1"}
    assert writer.streams.messages["/marks"] == 1


def test_standard_readers_keep_the_order_and_see_the_schemas(tmp_path):
    writer = TrafficWriter(tmp_path / "t.mcap")
    recorder = Recorder(writer)
    recorder.on_received("hand", b"late", 100)
    recorder.on_transmitted("hand", b"early", 90)
    recorder.event(SessionEvent(EventKind.TARE, 90))
    recorder.log(100, Level.WARNING, "hand", "warm")
    recorder.image(110, b"\x89PNG....")
    recorder.truth(120, Pose3())
    recorder.slam(130, Pose3(), {"n_eff": 3.0, "sigma": float("nan")})
    writer.close()
    with (tmp_path / "t.mcap").open("rb") as file:
        found = [
            (channel.topic, schema.name if schema else None, message.data)
            for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages()
        ]
    assert [topic for topic, _, _ in found[:3]] == ["/link/hand/rx", "/link/hand/tx", "/marks"]
    names = {topic: name for topic, name, _ in found}
    assert names["/link/hand/rx"] == raw_frames.SCHEMA_NAME
    assert names["/events"] == "foxglove.Log"
    assert names["/camera/image"] == "foxglove.CompressedImage"
    assert names["/truth/object"] == names["/slam/pose"] == "foxglove.PoseInFrame"
    assert b'"sigma":null' in found[-1][2]


def test_names_of_links_may_hold_slashes():
    assert schemas.received_transport(schemas.received_topic("ft/FF")) == "ft/FF"
    assert schemas.received_transport(schemas.transmitted_topic("ft/FF")) is None
    assert schemas.received_transport("/marks") is None


def test_state_samples_are_thinned_out():
    recorder = Recorder(NullRecorder())
    due = [stamp for stamp in range(0, 1_000_000_000, STEP_ns) if recorder.state_due(stamp)]
    assert len(due) == 13


@QUICK
@given(data=st.data())
def test_a_file_cut_off_anywhere_loses_no_complete_chunk_and_tells(whole, tmp_path_factory, data):
    size = data.draw(st.integers(0, len(whole) - 1))
    path = tmp_path_factory.getbasetemp() / "torn.mcap"
    path.write_bytes(whole[:size])
    reader = TrafficReader(path)
    found = numbers(reader)
    assert found == list(range(len(found)))
    assert reader.loss.truncated
    assert "ends too early" in reader.loss.describe()
    complete = sum(end <= size for end in chunk_ends(whole))
    intact = tmp_path_factory.getbasetemp() / "intact.mcap"
    intact.write_bytes(whole[: chunk_ends(whole)[complete - 1]] if complete else whole[:8])
    assert found == numbers(TrafficReader(intact))
    assert len(found) >= complete


@QUICK
@given(data=st.data())
def test_damaged_bytes_never_give_wrong_messages_or_a_foreign_error(whole, tmp_path_factory, data):
    position = data.draw(st.integers(0, len(whole) - 1))
    content = bytearray(whole)
    content[position] ^= data.draw(st.integers(1, 255))
    path = tmp_path_factory.getbasetemp() / "damaged.mcap"
    path.write_bytes(content)
    with contextlib.suppress(SessionError):
        reader = TrafficReader(path)
        found = numbers(reader)
        assert found == sorted(set(found))
        assert len(found) == 200 or reader.loss


@QUICK
@given(data=st.data())
def test_messages_on_a_topic_are_those_among_all_whole_damaged_or_cut_off(whole, tmp_path_factory, data):
    content = bytearray(whole[: data.draw(st.integers(0, len(whole)) | st.just(len(whole)))])
    for position in data.draw(st.lists(st.integers(0, len(whole) - 1), max_size=2)):
        if position < len(content):
            content[position] ^= data.draw(st.integers(1, 255))
    path = tmp_path_factory.getbasetemp() / "some-topics.mcap"
    path.write_bytes(content)
    topics = {"/link/hand/tx", "/link/of/nobody"}
    with contextlib.suppress(SessionError):
        everything = list(TrafficReader(path).messages())
        chosen = list(TrafficReader(path).messages_on(topics))
        assert chosen == [message for message in everything if message.topic in topics]


def test_messages_on_a_topic_of_a_killed_writer_include_its_tail(tmp_path):
    writer = record(tmp_path / "t.mcap", close=False)
    reader = TrafficReader(tmp_path / "t.mcap")
    chosen = list(reader.messages_on({"/link/hand/tx"}))
    writer.close()
    assert [int.from_bytes(message.data[:4], "little") for message in chosen] == list(range(1, 200, 3))


def test_a_damaged_chunk_is_left_out_and_the_gap_is_counted(whole, tmp_path):
    ends = chunk_ends(whole)
    content = bytearray(whole)
    content[ends[3] - 10] ^= 0xFF
    (tmp_path / "t.mcap").write_bytes(content)
    reader = TrafficReader(tmp_path / "t.mcap")
    found = numbers(reader)
    assert reader.loss.damaged_chunks == 1
    assert reader.loss.missing_messages == 200 - len(found) > 0
    assert not reader.loss.truncated
    assert found[-1] == 199
    assert reader.loss.counts() == {"damaged_chunks": 1, "missing_messages": 200 - len(found)}


def test_a_killed_writer_loses_at_most_a_tenth_of_a_second(tmp_path):
    writer = record(tmp_path / "t.mcap", close=False)
    writer.settle()
    reader = TrafficReader(tmp_path / "t.mcap")
    found = numbers(reader)
    writer.close()
    assert reader.loss.truncated
    assert (199 - found[-1]) * STEP_ns // 3 <= traffic.FLUSH_PERIOD_ns


def test_large_messages_close_their_chunk_at_once(tmp_path):
    writer = TrafficWriter(tmp_path / "t.mcap")
    writer.write("/link/camera/rx", os.urandom(100_000), 0)
    writer.settle()
    assert [len(message.data) for message in TrafficReader(tmp_path / "t.mcap").messages()] == [100_000]
    writer.close()


def foreign(path, profile):
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start(profile=profile)
        writer.add_message(writer.register_channel("/x", "json", 0), 0, b"{}", 0)
        writer.finish()


@pytest.mark.parametrize("profile", ["ros2", "", "tactile-lab"])
def test_a_foreign_mcap_is_named(tmp_path, profile):
    foreign(tmp_path / "other.mcap", profile)
    with pytest.raises(SessionError, match=r"other\.mcap: .*(not one of a session|does not say in which version)"):
        TrafficReader(tmp_path / "other.mcap")


@pytest.mark.parametrize("content", [b"PK\x03\x04 no mcap at all", b"\x89MCAP1\r\n", b"x"])
def test_a_file_that_is_no_mcap_is_named(tmp_path, content):
    (tmp_path / "photo.jpg").write_bytes(content)
    with pytest.raises(SessionError, match=r"photo\.jpg: not an MCAP file"):
        TrafficReader(tmp_path / "photo.jpg")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(SessionError, match="No such file"):
        TrafficReader(tmp_path / "none.mcap")
    with pytest.raises(SessionError, match="cannot be opened"):
        TrafficReader(tmp_path)


def test_a_traffic_file_is_never_overwritten(tmp_path):
    (tmp_path / "t.mcap").write_bytes(b"precious")
    with pytest.raises(SessionError, match="exists already"):
        TrafficWriter(tmp_path / "t.mcap")
    assert (tmp_path / "t.mcap").read_bytes() == b"precious"


def test_a_full_disk_is_told_and_what_was_recorded_is_kept(tmp_path, monkeypatch):
    room = [6000]

    def write(descriptor, data, real=os.write):
        if not room[0]:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        part = bytes(data[: room[0]])
        room[0] -= len(part)
        return real(descriptor, part)

    writer = TrafficWriter(tmp_path / "t.mcap")
    monkeypatch.setattr(traffic_disk.os, "write", write)
    with pytest.raises(SessionError, match=r"t\.mcap: the disk is full\. The \d+ bytes"):
        fill(writer, 100_000)
    with pytest.raises(SessionError, match="the disk is full"):
        writer.write("/link/hand/rx", b"", 0)
    with pytest.raises(SessionError, match="the disk is full"):
        writer.flush()
    writer.close()
    reader = TrafficReader(tmp_path / "t.mcap")
    found = numbers(reader)
    assert found == list(range(len(found)))
    assert len(found) > 10
    assert reader.loss.truncated
    assert reader.loss.unreadable_bytes == 0


def test_a_failing_disk_found_by_the_sync_ends_the_recording(tmp_path, monkeypatch):
    def fail(descriptor):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(traffic_disk, "SYNC_PERIOD_s", 0.001)
    monkeypatch.setattr(traffic_disk.os, "fdatasync", fail)
    writer = TrafficWriter(tmp_path / "t.mcap")
    writer._syncer.join(10.0)
    with pytest.raises(SessionError, match="Input/output error"):
        writer.write("/marks", b"{}", 0)
    writer.close()


def test_an_interrupt_inside_a_write_leaves_a_readable_file(tmp_path, monkeypatch):
    writer = record(tmp_path / "t.mcap", close=False)

    def interrupt(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(writer._segment.writer, "add_message", interrupt)
    with pytest.raises(KeyboardInterrupt):
        writer.write("/link/hand/rx", b"", 0)
    writer.close()
    reader = TrafficReader(tmp_path / "t.mcap")
    found = numbers(reader)
    assert found == list(range(len(found)))
    assert (199 - found[-1]) * STEP_ns // 3 <= traffic.FLUSH_PERIOD_ns
    assert reader.loss.truncated
    assert reader.loss.damaged_chunks == 0


def test_a_chunk_that_would_unpack_to_gigabytes_is_left_out(tmp_path):
    """A file of some kilobytes whose one chunk says so of itself, or does not: it is not unpacked."""
    record(tmp_path / "t.mcap", count=20)
    content = (tmp_path / "t.mcap").read_bytes()
    frame = zstandard.ZstdCompressor().compress(bytes(64 << 20))
    for claimed in (64 << 20, 1000):
        chunk = struct.pack("<QQQII", 0, 1, claimed, 0, 4) + b"zstd" + struct.pack("<Q", len(frame)) + frame
        bomb = struct.pack("<BQ", Opcode.CHUNK, len(chunk)) + chunk
        first = chunk_starts(content)[0]
        (tmp_path / "bomb.mcap").write_bytes(content[:first] + bomb + content[first:])
        reader = TrafficReader(tmp_path / "bomb.mcap")
        assert numbers(reader) == list(range(20))
        assert reader.loss.damaged_chunks == 1


def chunk_starts(content):
    """Offset of each chunk."""
    starts, position = [], 8
    while position < len(content) - 8:
        opcode, length = struct.unpack_from("<BQ", content, position)
        if opcode == 6:
            starts.append(position)
        position += 9 + length
    return starts
