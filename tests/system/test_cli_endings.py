"""Sessions that do not end by themselves: Ctrl+C, termination, a kill, a full disk. Each leaves a readable session."""

from __future__ import annotations

import errno
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sessions.recording.traffic import disk as traffic_disk
from tests.support.interruptible import interruptible
from tests.support.low_rig import low_rig
from tests.support.warm_terminal import Piped, WarmProgram

ENVIRONMENT = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


def start(program: WarmProgram, root: Path, grasps: int = 8, method: str = "odometry") -> Piped:
    rig = low_rig(root.parent)
    words = ("--rig", rig, "--grasps", grasps, "--seed", 1, "--method", method, "--out", root)
    return program.pipes(root, "run", *words)


def only_session(root: Path) -> Path:
    (folder,) = root.iterdir()
    return folder


def await_more(recording: Path) -> None:
    size = recording.stat().st_size
    while recording.stat().st_size == size:
        time.sleep(0.005)


def status(folder: Path) -> str:
    return re.findall(r"^status: (\w+)$", (folder / "session.yaml").read_text(), re.M)[0]


@pytest.mark.long
def test_one_request_to_end_finishes_the_grasp_and_judges_what_there_is(program, tmp_path):
    process = start(program, tmp_path)
    process.until(r"^ +1/8 ")
    process.send_signal(signal.SIGTERM)  # Ctrl+C goes the same way, see below
    assert process.ended() == 130
    assert "interrupted" in process.told
    folder = only_session(tmp_path)
    assert status(folder) == "interrupted"
    evaluation = json.loads((folder / "results" / "evaluation.json").read_text())
    assert 1 <= evaluation["grasps"] <= 2


@pytest.mark.long
def test_two_requests_end_at_once_and_the_recording_replays(program, tmp_path, inside):
    process = start(program, tmp_path)
    process.until(r"^ +1/8 ")
    process.send_signal(signal.SIGINT)
    time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    assert process.ended() == 130
    folder = only_session(tmp_path)
    assert status(folder) == "interrupted"
    assert f"tactile-lab session replay {folder}" in process.told
    answer = inside("session", "replay", folder, "--json")
    assert answer.code in (0, 3)
    assert json.loads(answer.out)["grasps"] >= 1


@pytest.mark.long
def test_a_killed_session_is_open_and_replays_up_to_the_end(program, tmp_path, inside):
    process = start(program, tmp_path)
    process.until(r"^ +1/8 ")
    folder = only_session(tmp_path)
    for _ in range(3):  # pieces of the recording, so that the first grasp is in one of them
        await_more(folder / "traffic.mcap")
    process.send_signal(signal.SIGKILL)
    assert process.ended() == -signal.SIGKILL
    (listed,) = json.loads(inside("session", "list", "--root", tmp_path, "--json").out)
    assert listed["status"] == "damaged"
    answer = inside("session", "replay", folder)
    assert answer.code in (0, 3)
    assert answer.code == 0 or "the file ends too early" in answer.err
    assert (folder / "results" / "evaluation.json").is_file()
    assert inside("report", folder).code == 0


def await_heeding(process: subprocess.Popen) -> None:
    """Until the program has taken signals into its own hands: before that, Python itself is starting."""
    while process.poll() is None:
        caught = re.findall(r"^SigCgt:\s*(\w+)", Path(f"/proc/{process.pid}/status").read_text(), re.M)[0]
        if int(caught, 16) >> (signal.SIGALRM - 1) & 1:
            return
        time.sleep(0.005)


@pytest.mark.parametrize("delay_s", [0.0, pytest.param(1.5, marks=pytest.mark.long)])
def test_ctrl_c_at_the_beginning(tmp_path, delay_s):
    """At the earliest instant it can heed, and while it loads or has just begun: in a process that loads by itself."""
    words = [sys.executable, "-m", "tactile_lab.cli.main", "run", "--seed", "1", "--out", str(tmp_path)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(interruptible(words), env=ENVIRONMENT, **pipes) as process:
        await_heeding(process)
        time.sleep(delay_s)
        process.send_signal(signal.SIGINT)
        out, told = process.communicate(timeout=120)
    assert "Traceback" not in out + told
    assert process.returncode == 130


@pytest.mark.long
def test_ctrl_c_while_the_result_is_judged_keeps_the_session(program, tmp_path, inside):
    process = start(program, tmp_path, grasps=1, method="joint")  # judging it takes a while
    process.until(r"^ +1/1 ")
    while status(folder := only_session(tmp_path)) == "open":
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    assert process.ended() == 130 or "report" in process.told  # it may have been ready already
    assert status(folder) == "closed"
    shown = json.loads(inside("session", "show", folder, "--json").out)
    assert (shown["counts"]["grasps"], shown["data_loss"]) == (1, {})


@pytest.mark.long  # quicker: test_recorder_accidents
def test_a_full_disk_ends_the_session_and_the_recorded_part_replays(tmp_path, inside, monkeypatch):
    rig, room, write = low_rig(tmp_path.parent), [900_000], os.write

    def write_while_there_is_room(descriptor: int, data: bytes) -> int:
        room[0] -= len(data)
        if room[0] < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(descriptor, data)

    with monkeypatch.context() as patched:
        patched.setattr(traffic_disk.os, "write", write_while_there_is_room)
        answer = inside("run", "--rig", rig, "--grasps", 4, "--seed", 1, "--method", "odometry", "--out", tmp_path)
    assert answer.code == 1
    assert "the disk is full" in answer.err
    folder = only_session(tmp_path)
    assert status(folder) == "failed"
    assert "the disk is full" in inside("session", "show", folder).out
    answer = inside("session", "replay", folder)
    assert answer.code in (1, 3)
    assert "grasps could be read" in answer.err
