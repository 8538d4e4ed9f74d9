"""The recorder at full load, in a process of its own, through accidents: counted message by message."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import asdict

import pytest

from drivers.core.errors import SessionError
from sessions.recording.session import Session
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.data.recorder_load import STREAMS, LoadSettings, number_of, payload, read_status
from tactile_lab.experiments.runs import crash_runs


def figures(fault, seed):
    return crash_runs.crash_and_recover(Cell((("fault", fault),), seed))


def in_time(fault, seeds):
    """The first accident in which the machine gave the recorder its turn in time; what is lost out of order raises."""
    for seed in seeds:
        try:
            return figures(fault, seed)
        except SessionError as error:
            if "ms lost at the end" not in str(error):
                raise
    raise AssertionError("more than a tenth of a second lost every time")


def test_a_killed_recording_comes_back_up_to_the_last_tenth_of_a_second():
    found = in_time(crash_runs.KILL, (3, 1, 6, 8))
    assert found["recovered"] > 500
    assert found["lost_ms"] <= crash_runs.ALLOWED_LOSS_ms


@pytest.mark.skipif(bool(crash_runs.needs_root()), reason=crash_runs.needs_root())
@pytest.mark.parametrize("fault", [crash_runs.FULL, crash_runs.READ_ONLY])
def test_a_disk_that_takes_nothing_more_ends_the_session_in_order(fault):
    found = figures(fault, 1)
    assert found.get("closed", 1.0) == 1.0
    assert (found["recovered"] > 1000) == (fault == crash_runs.FULL)


def test_a_clock_that_jumps_back_loses_nothing_and_the_late_messages_are_counted():
    found = figures(crash_runs.BACK, 1)
    assert (found["lost"], found["drops"]) == (0, 0)
    assert 0.8 * 7000 < found["late"] < 7100


def test_a_queue_that_overflows_drops_whole_parts_and_counts_every_message(tmp_path):
    settings = LoadSettings(seconds=3.0, stall_tick=500, stall_s=1.5, queue_bytes=400_000)
    words = [sys.executable, "-m", "tactile_lab.experiments.data.recorder_load", tmp_path / "runs", tmp_path / "status"]
    (tmp_path / "runs").mkdir()
    subprocess.run([*words, json.dumps(asdict(settings))], check=True, timeout=60)
    (folder,) = (tmp_path / "runs").iterdir()
    session, sent = Session.open(folder), read_status(tmp_path / "status").counts
    reader, found = session.traffic(), dict.fromkeys(STREAMS, 0)
    for message in reader.messages():
        if (stream := message.topic.removeprefix("/link/")) in STREAMS:
            assert number_of(stream, message.data) >= 0
            found[stream] += 1
    dropped = {stream: session.manifest.streams[f"/link/{stream}"]["dropped"] for stream in STREAMS}
    assert dropped["hand/rx"] > 100
    assert {stream: found[stream] + dropped[stream] for stream in STREAMS} == sent
    assert session.manifest.data_loss["queue drops /link/hand/rx"] == dropped["hand/rx"]
    assert reader.loss.missing_messages >= sum(dropped.values())
    assert reader.streams()["/link/hand/rx"]["dropped"] == dropped["hand/rx"]
    assert not reader.loss.truncated


def test_every_message_of_the_load_is_recognised_and_no_other():
    for stream in STREAMS:
        for number in (0, 1, 977):
            content = payload(stream, number)
            assert number_of(stream, content) == number
            assert number_of(stream, content[:-1]) == -1
            assert number_of(stream, content[:-1] + bytes([content[-1] ^ 1])) == -1
