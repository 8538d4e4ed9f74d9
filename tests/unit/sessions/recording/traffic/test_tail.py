"""The last moments of a recording in shared memory: there after a kill, gone after a proper end."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest

from sessions.recording.traffic import tail
from sessions.recording.traffic.reader import TrafficReader
from sessions.recording.traffic.tail import Tail, TailMessage, read_tail, tail_path
from sessions.recording.traffic.writer import TrafficWriter

pytestmark = pytest.mark.skipif(not Path("/dev/shm").is_dir(), reason="no shared memory on this computer")
TOPIC = "/link/hand/rx"


@pytest.fixture(autouse=True)
def own_memory(tmp_path, monkeypatch):
    """A folder instead of the memory that all programs share."""
    folder = tmp_path / "shared"
    folder.mkdir()
    monkeypatch.setattr(tail, "_SHARED", folder)
    return folder


def message(number: int, size: int = 10) -> TailMessage:
    return TailMessage(TOPIC, number, number, number, bytes([number % 256]) * size)


def test_a_killed_recording_has_every_message_that_was_handed_to_it(tmp_path):
    path = tmp_path / "traffic.mcap"
    process = os.fork()
    if process == 0:
        writer = TrafficWriter(path)
        for number in range(50):  # far less than a chunk
            writer.write(TOPIC, number.to_bytes(4, "little"), number)
        os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(process, 0)
    reader = TrafficReader(path)
    assert [int.from_bytes(found.data, "little") for found in reader.messages()] == list(range(50))
    assert (reader.loss.truncated, reader.loss.missing_messages) == (True, 0)


def test_a_complete_recording_has_no_tail(tmp_path, own_memory):
    path = tmp_path / "traffic.mcap"
    writer = TrafficWriter(path)
    writer.write(TOPIC, b"x", 1)
    assert len(read_tail(path)) == 1
    writer.close()
    assert not tail_path(path).is_symlink()
    assert not list(own_memory.iterdir())


def test_the_newest_messages_take_the_place_of_the_oldest(tmp_path):
    ring = Tail(tmp_path / "traffic.mcap", size=1000)
    for number in range(100):
        ring.append(message(number, 10 + number))
    ring.append(message(100, 2000))  # larger than the ring
    found = read_tail(tmp_path / "traffic.mcap")
    assert [one.sequence for one in found][-3:] == [97, 98, 99]
    assert found[-1] == message(99, 109)


def test_what_is_damaged_is_left_out(tmp_path, own_memory):
    ring = Tail(tmp_path / "traffic.mcap")
    for number in range(3):
        ring.append(message(number))
    (file,) = own_memory.iterdir()
    content = bytearray(file.read_bytes())
    content[content.index(b"\x01" * 10)] ^= 1
    file.write_bytes(content)
    assert [one.sequence for one in read_tail(tmp_path / "traffic.mcap")] == [0, 2]


def test_a_link_that_leads_elsewhere_is_not_followed(tmp_path, own_memory):
    Tail(tmp_path / "traffic.mcap").append(message(1))
    (file,) = own_memory.iterdir()
    elsewhere = tmp_path / "tactile-lab-x.tail"
    elsewhere.write_bytes(file.read_bytes())
    link = tail_path(tmp_path / "other.mcap")
    link.symlink_to(elsewhere)
    assert read_tail(tmp_path / "other.mcap") == []
    link.unlink()
    (own_memory / "tactile-lab-y.tail").symlink_to(elsewhere)
    link.symlink_to(own_memory / "tactile-lab-y.tail")
    assert read_tail(tmp_path / "other.mcap") == []


def test_rings_without_a_folder_go_when_the_next_recording_begins(tmp_path, own_memory):
    for name in ("kept", "deleted", "young"):
        (tmp_path / name).mkdir()
        Tail(tmp_path / name / "traffic.mcap").close(complete=False)
        ring = (tmp_path / name / "traffic.tail").readlink()
        if name != "young":
            os.utime(ring, (time.time() - 1000,) * 2)
        if name != "kept":
            tail_path(tmp_path / name / "traffic.mcap").unlink()
    tail.open_tail(tmp_path / "traffic.mcap").close(complete=True)
    assert len(list(own_memory.iterdir())) == 2


def test_without_shared_memory_there_is_no_tail_and_no_complaint(tmp_path, monkeypatch):
    monkeypatch.setattr(tail, "_SHARED", tmp_path / "nowhere")
    tail.open_tail(tmp_path / "traffic.mcap").append(message(1))
    assert read_tail(tmp_path / "traffic.mcap") == []
