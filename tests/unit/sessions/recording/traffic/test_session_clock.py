"""A transport whose clock jumps is blamed alone; what the hand lost is a loss of the session."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from drivers.core.transports import Datagram
from sessions.recording.recorder import NullTraffic, Recorder
from sessions.recording.traffic.raw_frames import UNSTAMPED
from sessions.recording.traffic.session_clock import JUMP_ns, SessionClock
from sessions.recording.traffic.stream_counts import StreamCounts
from sessions.recording.traffic.writer import TrafficWriter
from tests.support.session_fakes import make_rig

JUMPED_ns = 10_000_000_000


def test_a_link_whose_stamps_jump_ahead_does_not_carry_the_time_along() -> None:
    time = SessionClock()
    for stamp_ns in range(0, 100, 10):
        time.on_received("base", stamp_ns)
        time.on_received("hand", stamp_ns + JUMPED_ns * (stamp_ns > 50))
    assert time.now_ns == 90
    assert time.ahead_ns() == {"hand": JUMPED_ns}


def test_a_session_that_paused_is_no_jump() -> None:
    time = SessionClock()
    time.on_received("hand", 0)
    time.on_received("base", 0)
    time.on_received("hand", 2 * JUMP_ns)
    time.on_received("base", 2 * JUMP_ns + 5)
    assert (time.now_ns, time.ahead_ns()) == (2 * JUMP_ns + 5, {})


def test_what_the_program_stamps_and_a_link_that_is_alone_are_believed() -> None:
    time = SessionClock()
    time.on_received("hand", 0)
    time.on_received("hand", JUMPED_ns)
    assert time.now_ns == JUMPED_ns
    time.on_received("base", JUMPED_ns)
    time.on_stamp(2 * JUMPED_ns)
    assert time.now_ns == 2 * JUMPED_ns


def test_the_messages_of_the_others_are_not_late_when_one_link_jumps() -> None:
    counts = StreamCounts()
    for stamp_ns in range(0, 3_000_000_000, 10_000_000):
        counts.take("/link/ft/FF/rx", stamp_ns, UNSTAMPED)
        counts.take("/link/camera/rx", stamp_ns + JUMPED_ns * (stamp_ns > 10**9), UNSTAMPED)
        counts.take("/camera/image", stamp_ns + JUMPED_ns * (stamp_ns > 10**9), UNSTAMPED)
    assert counts.losses() == {}
    counts.take("/link/ft/FF/rx", 10**9, UNSTAMPED)
    assert counts.losses() == {"late /link/ft/FF/rx": 1}


def test_a_recording_blames_nobody_else_for_a_link_that_jumped(tmp_path: Path) -> None:
    writer = TrafficWriter(tmp_path / "t.mcap")
    for stamp_ns in range(0, 4_000_000_000, 10_000_000):
        writer.write("/link/hand/tx", b"", stamp_ns)
        writer.write("/link/hand/rx", b"", stamp_ns + JUMPED_ns * (stamp_ns > 10**9))
    writer.close()
    assert writer.streams.losses() == {}
    assert writer.streams.messages["/recorder/streams"] == 3


def test_a_bench_names_the_link_that_jumped_once_and_counts_what_its_hand_lost() -> None:
    rig, heard = make_rig(Recorder(NullTraffic()), unsteady=False), []
    rig.runtime.report_problems_to(heard.append)
    rig.runtime.connect()
    read = rig.peers["base"].read
    rig.peers["base"].read = lambda: [Datagram(one.payload, one.stamp_ns + JUMPED_ns) for one in read()]
    rig.runtime.run(300_000_000)
    rig.devices["hand"].lost = {"lost cycles": 3}
    rig.runtime.close()
    assert heard == ["base: its stamps are 10.0 s ahead of all others', its clock has jumped"]
    assert rig.runtime.losses == {"lost cycles hand": 3, "clock jumps base": 1}
    assert np.isfinite(rig.runtime.perception.hand.base_q).all()
