from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass, field

import numpy as np
import pytest
from gtsam import Pose3

from drivers.core.errors import DeviceError, SessionError
from sessions.recording.recorder import Level, Recorder
from tests.support.session_fakes import CYCLE_ns, make_rig, play_session


@dataclass
class Memory:
    """A traffic sink that keeps everything."""

    messages: list = field(default_factory=list)

    def write(self, topic, data, stamp_ns):
        self.messages.append((topic, data, stamp_ns))

    def topics(self):
        return Counter(topic for topic, _, _ in self.messages)


@dataclass(frozen=True)
class Truth:
    world_T_object: Pose3
    contacts: tuple = ()


def test_connecting_waits_until_hand_and_positioner_have_answered():
    rig = make_rig(unsteady=False)
    rig.runtime.connect()
    assert rig.runtime.perception.hand.ready
    assert [call for call in rig.calls if call.startswith("connect")][:2] == ["connect hand", "connect base"]
    rig.runtime.close()


@pytest.mark.parametrize("failing", ["hand", "base", "ft/LF", "camera"])
def test_a_device_that_does_not_connect_undoes_all(failing):
    rig = make_rig()
    rig.devices[failing].connect_error = DeviceError("no answer", where=failing)
    with pytest.raises(DeviceError, match=f"{failing}: no answer"):
        rig.runtime.connect()
    connected = {call.split()[1] for call in rig.calls if call.startswith("connect")}
    assert connected <= {call.split()[1] for call in rig.calls if call.startswith("close")}
    rig.devices[failing].connect_error = None
    rig.runtime.connect()
    rig.runtime.close()


def test_a_failure_while_undoing_is_noted_and_does_not_hide_the_first():
    rig = make_rig()
    rig.devices["camera"].connect_error = DeviceError("no picture", where="camera")
    rig.devices["base"].close_error = DeviceError("stuck", where="base")
    with pytest.raises(DeviceError, match="no picture") as caught:
        rig.runtime.connect()
    assert any("base: stuck" in note for note in caught.value.__notes__)
    assert "close hand" in rig.calls


def test_silence_after_connecting_is_an_error_that_ends():
    rig = make_rig()
    rig.peers["base"].read = list
    with pytest.raises(DeviceError, match="no sample from the hand or the positioner within 2 s"):
        rig.runtime.connect()
    assert rig.calls[-1] == "close hand"


def test_closing_stops_first_reaches_every_device_and_may_be_repeated():
    rig = make_rig()
    rig.runtime.connect()
    rig.devices["ft/TH"].close_error = DeviceError("gone", where="ft/TH")
    rig.calls.clear()
    with pytest.raises(DeviceError, match="ft/TH: gone"):
        rig.runtime.close()
    assert rig.calls[:2] == ["stop hand", "stop base"]
    assert [call for call in rig.calls if call.startswith("close")][-2:] == ["close base", "close hand"]
    rig.devices["ft/TH"].close_error = None
    rig.runtime.close()


def test_stop_reaches_hand_and_positioner():
    rig = make_rig()
    rig.runtime.stop()
    assert rig.calls == ["stop hand", "stop base"]


def test_cycles_lie_on_a_fixed_grid():
    rig = make_rig(unsteady=False)
    rig.runtime.connect()
    start_ns = rig.clock.now_ns()
    for _ in range(10):
        rig.runtime.cycle()
    assert rig.clock.now_ns() == start_ns + 10 * CYCLE_ns
    assert rig.runtime.counts.overruns == 0
    rig.runtime.close()


def test_a_slow_cycle_is_counted_and_does_not_move_the_grid():
    rig = make_rig(unsteady=False)
    rig.runtime.connect()
    start_ns = rig.clock.now_ns()
    rig.devices["hand"].work_ns = 2 * CYCLE_ns + 1
    rig.runtime.cycle()
    rig.devices["hand"].work_ns = CYCLE_ns // 2
    rig.runtime.cycle()
    assert rig.clock.now_ns() == start_ns + 4 * CYCLE_ns
    assert (rig.runtime.counts.overruns, rig.runtime.counts.skipped) == (1, 2)
    rig.runtime.close()


def test_a_failure_says_too_that_the_session_itself_was_late(monkeypatch):
    def fail():
        raise DeviceError("no command from the session for 2.0 s", where="hand", hint="Resume it")

    rig = make_rig(unsteady=False)
    rig.runtime.connect()
    monkeypatch.setattr(rig.runtime.hand, "exchange", fail)
    with pytest.raises(DeviceError, match=r"^hand: no command from the session for 2\.0 s\. Resume it$"):
        rig.runtime.cycle()
    monkeypatch.undo()
    rig.devices["hand"].work_ns = 3_000_000_000
    rig.runtime.cycle()
    monkeypatch.setattr(rig.runtime.hand, "exchange", fail)
    with pytest.raises(DeviceError, match=r"2\.0 s\. The session itself was late: 3\.0 s taking in .*\. Resume it$"):
        rig.runtime.cycle()
    monkeypatch.undo()
    rig.runtime.close()


def test_bytes_are_recorded_before_they_are_understood():
    memory = Memory()
    rig = make_rig(Recorder(memory), unsteady=False)
    seen = []

    def on_hand(sample):
        seen.append(memory.messages[-1][:2] == ("/link/hand/rx", np.asarray(sample.joints_rad).tobytes()))

    rig.interpreter._routes["hand"] = lambda datagram: on_hand(rig.interpreter.hand_sample(datagram))
    rig.interpreter.hand_sample = lambda datagram: type("S", (), {"joints_rad": np.frombuffer(datagram.payload)})
    for device in rig.devices.values():
        device.connect()
    rig.runtime.cycle()
    rig.runtime.cycle()
    assert seen == [True, True]
    assert [topic for topic, _, _ in memory.messages[:2]] == ["/link/hand/tx", "/link/hand/rx"]


class FullAfter(Memory):
    """A traffic sink with room for some messages."""

    room = 0

    def write(self, topic, data, stamp_ns):
        if len(self.messages) >= self.room:
            raise SessionError("the disk is full", where="traffic.mcap")
        super().write(topic, data, stamp_ns)


def test_a_recorder_that_fails_stops_the_cycle_before_anything_is_understood():
    rig = make_rig(Recorder(FullAfter()))
    with pytest.raises(SessionError, match="the disk is full"):
        rig.runtime.connect()
    assert not rig.runtime.perception.hand.ready


@pytest.mark.parametrize("room", [50, 51, 52, 53, 54])
def test_after_a_failed_recording_the_hand_can_still_be_stopped(room):
    sink = FullAfter()
    sink.room = room
    rig = make_rig(Recorder(sink), unsteady=False)
    rig.runtime.connect()
    with pytest.raises(SessionError, match="the disk is full"):
        rig.runtime.run(1_000_000_000)
    sent = len(rig.peers["hand"].received)
    rig.runtime.stop()
    rig.devices["hand"].exchange()
    assert len(rig.peers["hand"].received) == sent + 1
    with pytest.raises(SessionError, match="the disk is full"):
        rig.runtime.begin_capture()
    rig.runtime.close()
    assert "close hand" in rig.calls
    assert len(sink.messages) == room


def test_a_session_leaves_samples_marks_contacts_and_truth():
    memory = Memory()
    pose = Pose3()
    rig = make_rig(Recorder(memory), truth=lambda: Truth(pose))
    play_session(rig)
    rig.runtime.log(Level.INFO, "conductor", "the end")
    rig.runtime.close()
    topics = memory.topics()
    seconds = rig.clock.now_ns() / 1e9
    assert 0.7 * 12.5 * seconds < topics["/hand/joints"] <= 12.5 * seconds + 1
    assert topics["/hand/joints"] == topics["/hand/loads"] == topics["/tf"]
    assert topics["/contacts"] == topics["/camera/image"] == 3
    assert topics["/marks"] == 1 + 3 * (2 + 1 + 4)
    assert topics["/truth/object"] >= topics["/hand/joints"]
    joints = json.loads(next(data for topic, data, _ in memory.messages if topic == "/hand/joints"))
    names = [joint["name"] for joint in joints["joints"]]
    assert set(names[24:]) == {"x_m", "y_m", "z_m", "yaw_rad", "pitch_rad", "roll_rad"}
    assert len(names) == 30


def test_a_refused_tare_is_reported_and_recorded():
    memory = Memory()
    rig = make_rig(Recorder(memory), unsteady=False)
    rig.peers["ft/MF"].read = list
    rig.runtime.connect()
    report = rig.runtime.tare(("FF", "MF"))
    assert list(report.refused) == ["MF"]
    events = [json.loads(data) for topic, data, _ in memory.messages if topic == "/events"]
    assert [(event["name"], event["level"]) for event in events] == [("MF", 3)]
    rig.runtime.close()


def test_unknown_fingers_are_refused_before_anything_is_recorded():
    memory = Memory()
    rig = make_rig(Recorder(memory))
    with pytest.raises(SessionError, match="no finger called XX"):
        rig.runtime.tare(("XX",))
    assert memory.messages == []


def test_the_cycles_go_on_while_a_picture_is_on_its_way(monkeypatch):
    rig = make_rig()
    rig.runtime.connect()
    peer = rig.peers["camera"]
    answers = iter([list, list, list, list, peer.read])
    monkeypatch.setattr(peer, "read", lambda: next(answers)())
    before, looked = rig.runtime.counts.cycles, []

    def cycle():
        looked.append(rig.runtime.clock.now_ns())
        rig.runtime.cycle()

    assert rig.runtime.truth_frame(cycle) is not None
    assert rig.runtime.counts.cycles - before == len(looked) == 4
    assert rig.runtime.counts.overruns == 0
    rig.runtime.close()


def test_without_a_camera_there_is_no_truth_frame():
    rig = make_rig()
    rig.runtime.connect()
    rig.runtime.camera = None
    assert rig.runtime.truth_frame() is None
    rig.runtime.close()
