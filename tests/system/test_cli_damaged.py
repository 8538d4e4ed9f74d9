"""Session folders as they look after accidents: what can be read is read, what is lost is told."""

from __future__ import annotations

import json
import os
import shutil

import pytest
from mcap.writer import Writer

EVERY = ("session show", "session replay", "evaluate", "report")


def refused(answer, *words: str, code: int = 2) -> None:
    assert (answer.code, answer.out) == (code, ""), answer
    errors = [line for line in answer.err.splitlines() if line.startswith("error: ")]
    assert len(errors) == 1, answer.err
    for word in words:
        assert word in errors[0]


def foreign_mcap(path) -> None:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="another program")
        channel = writer.register_channel("/chatter", "json", 0)
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()


@pytest.mark.parametrize("command", EVERY)
def test_a_folder_that_is_no_session(inside, tmp_path, command):
    refused(inside(*command.split(), tmp_path), "not a session folder")


@pytest.mark.parametrize("share", [0.95, pytest.param(0.6, marks=pytest.mark.long)])
def test_a_recording_cut_off_is_replayed_up_to_the_cut(inside, session_copy, share):
    traffic = session_copy / "traffic.mcap"
    whole = traffic.read_bytes()
    traffic.write_bytes(whole[: int(share * len(whole))])
    answer = inside("session", "replay", session_copy, "--json")
    assert answer.code == 3
    assert "the file ends too early" in answer.err
    assert "of 2 grasps could be read" in answer.err
    assert "differs" not in answer.err
    document = json.loads(answer.out)
    assert 1 <= document["grasps"] <= 2
    recorded = (session_copy / "results" / "trajectory.csv").read_text().splitlines()
    replayed = (session_copy / "replay" / "trajectory.csv").read_text().splitlines()
    assert recorded[: 1 + document["grasps"]][0] == replayed[0]
    assert recorded[1] == replayed[1]


@pytest.mark.parametrize("size", [0, 5, 20, 300, 100_000])
def test_a_recording_cut_off_before_the_first_grasp(inside, session_copy, size):
    traffic = session_copy / "traffic.mcap"
    traffic.write_bytes(traffic.read_bytes()[:size])
    answer = inside("session", "replay", session_copy)
    assert answer.code == 1
    assert "no grasp was recorded" in answer.err
    assert "the file ends too early" in answer.err
    assert "0 of 2 grasps could be read" in answer.err


def inside_a_chunk(content, wanted):
    """The middle of the chunk of messages after a place of an MCAP file: what lies between chunks is read by nobody."""
    place, chunk = 8, 0x06
    while True:
        kind, length = content[place], int.from_bytes(content[place + 1 : place + 9], "little")
        if kind == chunk and place > wanted:
            return place + 9 + length // 2
        place += 9 + length


def test_a_recording_damaged_in_the_middle(inside, session_copy):
    traffic = session_copy / "traffic.mcap"
    content = bytearray(traffic.read_bytes())
    middle = inside_a_chunk(content, int(0.7 * len(content)))
    content[middle : middle + 50] = bytes(50)
    traffic.write_bytes(content)
    answer = inside("session", "replay", session_copy, "--method", "odometry")
    assert answer.code == 3
    assert "the recording is damaged" in answer.err


def test_traffic_that_is_not_the_sessions(inside, session_copy):
    traffic = session_copy / "traffic.mcap"
    foreign_mcap(traffic)
    refused(inside("session", "replay", session_copy), "not one of a session", "'ros2'")
    refused(inside("evaluate", session_copy), "not one of a session")
    traffic.write_bytes(b"hello" * 1000)
    refused(inside("session", "replay", session_copy), "not an MCAP file")
    traffic.unlink()
    refused(inside("session", "replay", session_copy), "cannot be opened")
    assert inside("session", "show", session_copy).code == 0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text + "colour: red\n", "colour: unknown key"),
        (lambda text: text.replace("grasps: 2\n", "grasps: .nan\n").replace("session: 1", "session: .nan"), "session"),
        (lambda text: text[: len(text) // 2], "session.yaml"),
        (lambda text: "", "must be keys with values"),
        (lambda text: text + "status: closed\n", "appears twice"),
    ],
)
def test_a_description_that_can_not_be_read(inside, session_copy, change, words):
    manifest = session_copy / "session.yaml"
    manifest.write_text(change(manifest.read_text()))
    for command in EVERY:
        refused(inside(*command.split(), session_copy), "session.yaml", words)
    listed = inside("session", "list", "--root", session_copy.parent)
    assert listed.code == 0
    assert "damaged" in listed.out
    assert words in listed.err


def test_settings_of_another_version(inside, session_copy):
    manifest = session_copy / "session.yaml"
    manifest.write_text(manifest.read_text().replace("method: joint", "method: magic"))
    answer = inside("session", "replay", session_copy)
    assert answer.code == 2
    assert "'magic'" in answer.err
    assert "the version of tactile-lab that recorded it" in answer.err


def test_a_calibration_copy_changed_or_missing(inside, session_copy):
    joints = session_copy / "calibration" / "joints.yaml"
    joints.write_text(joints.read_text() + "# a remark\n")
    refused(inside("session", "replay", session_copy), "joints.yaml", "changed since the recording")
    joints.unlink()
    refused(inside("session", "replay", session_copy), "joints.yaml", "cannot be read")


@pytest.mark.long
def test_deleted_results_are_made_again_by_a_replay(inside, session_copy):
    before = {path.name: path.read_bytes() for path in (session_copy / "results").iterdir()}
    shutil.rmtree(session_copy / "results")
    refused(inside("evaluate", session_copy), "trajectory", "Replay the session")
    refused(inside("report", session_copy), "trajectory", "Replay the session")
    answer = inside("session", "replay", session_copy)
    assert answer.code == 0
    assert {path.name for path in (session_copy / "results").iterdir()} == set(before)
    assert (session_copy / "results" / "mesh.ply").read_bytes() == before["mesh.ply"]
    assert inside("evaluate", session_copy).code == 0


def test_results_replaced_by_a_file(inside, session_copy):
    shutil.rmtree(session_copy / "results")
    (session_copy / "results").write_text("in the way")
    for command in ("evaluate", "session replay"):
        refused(inside(*command.split(), session_copy), "results", "Move the file that is in its place", code=1)


def test_results_that_can_not_be_read(inside, session_copy):
    (session_copy / "results" / "slam.json").write_text("{}")
    refused(inside("evaluate", session_copy), "slam.json")
    (session_copy / "results" / "trajectory.csv").write_text("a,b\n1,2\n")
    refused(inside("report", session_copy), "trajectory.csv")


def test_evaluating_a_damaged_recording_warns(inside, session_copy):
    traffic = session_copy / "traffic.mcap"
    traffic.write_bytes(traffic.read_bytes()[:1_000_000])
    answer = inside("evaluate", session_copy, "--json")
    assert answer.code == 3
    assert "the recording is damaged" in answer.err
    json.loads(answer.out)


@pytest.mark.long
def test_a_session_never_closed_is_shown_and_replayed(inside, session_copy):
    manifest = session_copy / "session.yaml"
    manifest.write_text(manifest.read_text().replace("status: closed", "status: open"))
    assert "killed before it was closed" in inside("session", "show", session_copy).out
    assert inside("session", "replay", session_copy, "--method", "odometry").code == 0


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("traffic.mcap", ("session", "replay")),
        ("traffic.mcap", ("session", "recover")),
        ("traffic.mcap", ("evaluate",)),
        ("traffic-2.mcap", ("evaluate",)),
        ("calibration/joints.yaml", ("session", "replay")),
    ],
)
def test_a_pipe_in_a_session_is_not_waited_for(inside, session_copy, file, words):
    (session_copy / file).unlink(missing_ok=True)
    os.mkfifo(session_copy / file)
    answer = inside(*words, session_copy)
    assert answer.code == 2
    assert f"{file}: " in answer.err
    assert "a pipe or device" in answer.err


def test_a_pipe_beside_a_recording_is_left_out_of_its_recovery(inside, session_copy):
    os.mkfifo(session_copy / "calibration" / "pipe")
    (session_copy / "calibration" / "joints.yaml").unlink()
    os.mkfifo(session_copy / "calibration" / "joints.yaml")
    assert inside("session", "recover", session_copy).code == 0
    recovered = session_copy.with_name("session-recovered")
    assert (recovered / "calibration" / "joints.yaml").is_file()
    assert not (recovered / "calibration" / "pipe").exists()


def test_results_that_are_nested_too_deeply_hide_no_others(inside, session_copy, tmp_path):
    for name in ("evaluation.json", "slam.json"):
        (session_copy / "results" / name).write_text(100_000 * "[")
    listed = inside("session", "catalogue", tmp_path, "--out", tmp_path / "all.csv")
    assert listed.code == 3
    assert "evaluation.json: is not readable JSON (nested too deeply)" in listed.err
    assert len((tmp_path / "all.csv").read_text().splitlines()) == 2
    assert "slam.json" in inside("session", "replay", session_copy).err
