from __future__ import annotations

import errno
import os
import time
from datetime import UTC, datetime

import pytest
from mcap.reader import make_reader

from drivers.core.errors import SessionError, WriteError
from sessions.recording import recovery
from sessions.recording.listing import left_open, list_sessions, summarize
from sessions.recording.manifest import read_manifest
from sessions.recording.recovery import recover
from sessions.recording.running_session import create_session
from sessions.recording.session import Session
from sessions.recording.traffic.settings import TrafficSettings

START = datetime(2026, 11, 21, 9, 30, 0, tzinfo=UTC)
COUNT = 2000


def record(root, *, calibration=None, segment_bytes=1 << 30, size=60):
    """A closed session: a hand at 1 kHz, a sensor at 500 Hz, and the calibration it used."""
    files = {"joints": calibration} if calibration else {}
    settings = TrafficSettings(segment_bytes=segment_bytes)
    arguments = {"rig": "sim", "rig_description": {}, "object_name": "box", "started": START}
    with create_session(root, **arguments, calibration_files=files, traffic_settings=settings) as session:
        for number in range(COUNT):
            session.recorder.on_received("hand", number.to_bytes(4, "little") + os.urandom(size), number * 1_000_000)
            if size > 60 and number % 50 == 0:
                time.sleep(0.005)  # files are ended by the thread that writes them, which has to come to it
            if number % 2:
                session.recorder.on_received("ft/FF", number.to_bytes(4, "little"), number * 1_000_000)
    return session.folder


def left_behind(folder, share):
    """As a killed program leaves a session: open, the recording cut off, no locks."""
    manifest = folder / "session.yaml"
    manifest.write_text(manifest.read_text().replace("status: closed", "status: open"))
    traffic = folder / "traffic.mcap"
    traffic.write_bytes(traffic.read_bytes()[: int(share * traffic.stat().st_size)])
    return folder


def numbers(folder, topic):
    messages = Session.open(folder).traffic().messages()
    return [int.from_bytes(message.data[:4], "little") for message in messages if message.topic == topic]


@pytest.mark.parametrize("share", [0.3, 0.77, 0.999])
def test_every_complete_chunk_of_a_torn_session_is_brought_back(tmp_path, share):
    folder = left_behind(record(tmp_path), share)
    readable = numbers(folder, "/link/hand/rx")
    recovery = recover(folder)
    assert recovery.lossy
    assert recovery.folder == tmp_path / f"{folder.name}-recovered"
    assert numbers(recovery.folder, "/link/hand/rx") == readable == list(range(len(readable)))
    manifest = read_manifest(recovery.folder)
    assert (manifest.status, manifest.data_loss["truncated"]) == ("recovered", 1)
    assert manifest.counts["/link/hand/rx"] == len(readable) == recovery.topics["/link/hand/rx"].read
    assert 90 <= recovery.topics["/link/hand/rx"].at_most_more <= 110 or len(readable) < 1000
    (step,) = manifest.derived
    assert step.words == f"recovered from {folder.name}, {step.made_utc}"


def test_a_session_that_was_only_not_closed_is_recovered_without_loss(tmp_path):
    folder = left_behind(record(tmp_path), 1.0)
    recovery = recover(folder)
    assert not recovery.lossy
    assert all(item.lost == item.at_most_more == 0 for item in recovery.topics.values())
    assert len(numbers(recovery.folder, "/link/hand/rx")) == COUNT
    assert summarize(recovery.folder).status == "recovered"


def largest_chunk(folder):
    """Where it begins, and how long it and the index behind it are; time and the machine's pace end chunks."""
    with (folder / "traffic.mcap").open("rb") as file:
        chunks = make_reader(file).get_summary().chunk_indexes
    chunk = max(chunks, key=lambda each: each.chunk_length)
    return chunk.chunk_start_offset, chunk.chunk_length, chunk.message_index_length


def overwrite(folder, place):
    traffic = folder / "traffic.mcap"
    content = bytearray(traffic.read_bytes())
    content[place : place + 20] = bytes(20)
    traffic.write_bytes(content)


def test_a_damaged_part_is_told_by_topic(tmp_path):
    folder = record(tmp_path)
    begin, length, _ = largest_chunk(folder)
    overwrite(folder, begin + length // 2)
    recovery = recover(folder)
    hand, tip = recovery.topics["/link/hand/rx"], recovery.topics["/link/ft/FF/rx"]
    assert hand.read + hand.lost == COUNT
    assert tip.read + tip.lost == COUNT // 2
    assert hand.lost > 0
    assert read_manifest(recovery.folder).data_loss["lost /link/hand/rx"] == hand.lost


def test_a_damaged_index_costs_no_message(tmp_path):
    folder = record(tmp_path)
    begin, length, index = largest_chunk(folder)
    overwrite(folder, begin + length + index // 2)
    recovery = recover(folder)
    assert recovery.folder is None
    assert not recovery.lossy
    assert numbers(folder, "/link/hand/rx") == list(range(COUNT))


def test_a_whole_session_needs_no_recovery(tmp_path):
    recovery = recover(record(tmp_path))
    assert recovery.folder is None
    assert not recovery.lossy
    assert len(list(tmp_path.iterdir())) == 1


def test_a_session_is_not_recovered_while_it_is_recorded(tmp_path):
    with create_session(tmp_path, rig="sim", rig_description={}, object_name="box") as session:
        session.recorder.on_received("hand", b"x", 0)
        assert summarize(session.folder).status == "open"
        assert left_open(tmp_path) == []
        with pytest.raises(SessionError, match="is being recorded"):
            recover(session.folder)


def test_a_description_that_was_spoilt_comes_back_from_the_recording(tmp_path):
    joints = tmp_path / "joints.yaml"
    joints.write_text("a: 1\n")
    folder = left_behind(record(tmp_path / "runs", calibration=joints), 0.9)
    (folder / "session.yaml").write_text("colour: red\n")
    (folder / "calibration" / "joints.yaml").unlink()
    recovery = recover(folder)
    assert read_manifest(recovery.folder).object_name == "box"
    assert Session.open(recovery.folder).calibration_file("joints").read_text() == "a: 1\n"


@pytest.mark.parametrize("damage", [lambda file: file.unlink(), lambda file: file.write_text("a: 2\n")])
def test_calibrations_of_a_whole_session_come_back_from_its_recording(tmp_path, damage):
    joints = tmp_path / "joints.yaml"
    joints.write_text("a: 1\n")
    folder = record(tmp_path / "runs", calibration=joints)
    damage(folder / "calibration" / "joints.yaml")
    with pytest.raises(SessionError, match=r"session recover .* takes it from the recording"):
        Session.open(folder).calibration_file("joints")
    recovery = recover(folder)
    assert Session.open(recovery.folder).calibration_file("joints").read_text() == "a: 1\n"
    assert not recovery.lossy


def spoil(folder, content):
    """One wrong bit where the recording stores this."""
    traffic = folder / "traffic.mcap"
    changed = bytearray(traffic.read_bytes())
    changed[changed.index(content)] ^= 4
    traffic.write_bytes(changed)


@pytest.mark.parametrize("content", [b"a: 1\n", b"status: open"])
def test_a_wrong_bit_in_a_file_that_the_recording_stores_is_told_and_spoils_no_sound_copy(tmp_path, content):
    joints = tmp_path / "joints.yaml"
    joints.write_text("a: 1\n")
    folder = record(tmp_path / "runs", calibration=joints)
    spoil(folder, content)
    recovery = recover(folder)
    assert recovery.lossy
    assert recovery.describe() == "1 damaged file stored in it"
    assert Session.open(recovery.folder).calibration_file("joints").read_text() == "a: 1\n"
    stored = [one.name for one in Session.open(recovery.folder).traffic().attachments()]
    assert stored == ["session.yaml", "calibration/joints.yaml"]
    assert not recover(recovery.folder).lossy


def test_a_calibration_without_any_sound_copy_is_told(tmp_path):
    joints = tmp_path / "joints.yaml"
    joints.write_text("a: 1\n")
    folder = record(tmp_path / "runs", calibration=joints)
    spoil(folder, b"a: 1\n")
    (folder / "calibration" / "joints.yaml").unlink()
    recovery = recover(folder)
    assert recovery.calibrations_lost == ("joints.yaml",)
    assert recovery.describe() == "1 damaged file stored in it; no sound copy of joints.yaml"
    assert "no sound copy of joints.yaml" in read_manifest(recovery.folder).problem


def test_a_session_without_its_recording_promises_no_recovery(tmp_path):
    joints = tmp_path / "joints.yaml"
    joints.write_text("a: 1\n")
    folder = record(tmp_path / "runs", calibration=joints)
    (folder / "calibration" / "joints.yaml").unlink()
    (folder / "traffic.mcap").unlink()
    with pytest.raises(SessionError, match="restore both from a copy"):
        Session.open(folder).calibration_file("joints")


def test_several_files_are_recovered_as_one_recording(tmp_path):
    folder = record(tmp_path, segment_bytes=100_000, size=600)
    files = sorted(folder.glob("traffic*.mcap"))
    assert len(files) > 3
    last = folder / f"traffic-{len(files)}.mcap"
    last.write_bytes(last.read_bytes()[:-300])
    recovery = recover(folder)
    assert recovery.lossy
    found = numbers(recovery.folder, "/link/hand/rx")
    assert found == list(range(len(found)))
    assert len(found) > 0.8 * COUNT
    assert [path.name for path in recovery.folder.glob("*.mcap")] == ["traffic.mcap"]


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n", b"hello"])
def test_a_recording_without_any_message_leaves_nothing_behind(tmp_path, content):
    folder = left_behind(record(tmp_path), 1.0)
    (folder / "traffic.mcap").write_bytes(content)
    with pytest.raises(SessionError, match=r"contains no readable message|not an MCAP"):
        recover(folder)
    assert [item.name for item in tmp_path.iterdir()] == [folder.name]


def test_a_list_tells_open_closed_recovered_and_damaged(tmp_path):
    closed = record(tmp_path)
    damaged = left_behind(record(tmp_path), 0.5)
    torn = record(tmp_path)
    (torn / "traffic.mcap").write_bytes((torn / "traffic.mcap").read_bytes()[:5000])
    assert [item.folder for item in left_open(tmp_path)] == [damaged]
    recovered = recover(damaged).folder
    with create_session(tmp_path, rig="sim", rig_description={}, object_name="box") as running:
        states = {item.folder: item.status for item in list_sessions(tmp_path)}
    assert states == {
        closed: "closed",
        damaged: "damaged",
        torn: "damaged",
        recovered: "recovered",
        running.folder: "open",
    }
    assert left_open(tmp_path) == []
    problems = {item.folder: item.problem for item in list_sessions(tmp_path)}
    assert f"tactile-lab session recover {damaged}" in problems[damaged]
    assert "is truncated" in problems[torn]


def test_results_of_the_torn_recording_stay_with_it_and_are_named(tmp_path):
    folder = left_behind(record(tmp_path), 0.9)
    for place in ("results", "replay", "studies/thesis-pf"):
        (folder / place).mkdir(parents=True, exist_ok=True)
        (folder / place / "trajectory.csv").write_text("stale")
    (folder / "studies" / "plan.txt").write_text("the operator's")
    (folder / "attachments").mkdir()
    (folder / "attachments" / "note.txt").write_text("the operator's")
    recovery = recover(folder)
    assert recovery.left_out == ("replay", "results", "studies/thesis-pf")
    assert not list(recovery.folder.rglob("trajectory.csv"))
    kept = {path.relative_to(recovery.folder).as_posix() for path in recovery.folder.rglob("*.txt")}
    assert kept == {"studies/plan.txt", "attachments/note.txt"}
    assert not (recovery.folder / "replay").exists()


def test_a_session_without_results_leaves_none_out(tmp_path):
    assert recover(left_behind(record(tmp_path), 0.9)).left_out == ()


def test_links_in_a_session_folder_are_not_followed(tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("mine")
    folder = left_behind(record(tmp_path / "runs"), 0.9)
    (folder / "note.txt").symlink_to(secret)
    recovery = recover(folder)
    assert not (recovery.folder / "note.txt").exists()


@pytest.mark.parametrize("kept_in", ["attachments", "."])
def test_a_recovery_onto_a_full_disk_is_told_and_leaves_nothing_behind(tmp_path, monkeypatch, kept_in):
    def fill(source, copy, **named):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    folder = left_behind(record(tmp_path), 0.9)
    (folder / kept_in).mkdir(exist_ok=True)
    (folder / kept_in / "photo.jpg").write_text("picture")
    monkeypatch.setattr(recovery.shutil, "copyfile", fill)
    with pytest.raises(WriteError, match=r"the disk is full\. Free some space"):
        recover(folder)
    assert list(tmp_path.iterdir()) == [folder]
