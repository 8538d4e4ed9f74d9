"""Every driver on a small log of our own simulated rig: the mock is the recording, the driver the very same."""

from __future__ import annotations

import re
from types import SimpleNamespace

import pytest

from drivers.ati.nano17 import Nano17, Nano17Settings
from drivers.camera.camera import Camera
from drivers.core.clock import VirtualClock
from drivers.core.errors import DeviceError
from drivers.core.fingertip import load_fingertips
from drivers.positioner.positioner import Positioner
from drivers.shadow.device.hand_samples import HandDecoder
from drivers.shadow.model.joint_calibration import JointCalibration
from sessions.perception.replay_rig import recorded_links
from sessions.recording.traffic.reader import TrafficMessage, TrafficReader
from sessions.recording.traffic.schemas import received_topic, transmitted_topic
from tactile_lab.rigs.description import load_rig
from tests.support.repository import LOGS, REPOSITORY


def recorded(log, transport, speed=1.0):
    clock = VirtualClock()
    return clock, recorded_links(TrafficReader(LOGS / f"{log}.mcap"), clock, speed)[transport]


def everything(log, transport):
    clock, source = recorded(log, transport)
    source.open()
    source.send(b"")  # the recording begins
    clock.sleep_until_ns(10**12)
    return source.receive()


@pytest.fixture(scope="module")
def files():
    return load_rig("sim").files


def test_the_hand_understands_its_log_as_it_did_then(files):
    decoder = HandDecoder(JointCalibration.load(files["joints"]))
    samples = [decoder.receive(datagram) for datagram in everything("hand", "hand")]
    assert len(samples) == 20
    assert decoder.counts.good == 20
    assert samples[-1].joints_rad[:3].tolist() == [0.4394361817093794, 0.7005899110118083, -0.12217304763960307]


def test_the_palm_with_biotacs_gives_the_slots_of_then(files):
    decoder = HandDecoder(JointCalibration.load(files["joints"]))
    samples = [decoder.receive(datagram) for datagram in everything("biotac-hand", "hand")]
    assert len(samples) == 50
    assert samples[-1].tactile[:16].hex() == "fb07f107920c0f00f80c000000000000"
    assert samples[-1].tactile_valid == 31


def test_the_positioner_understands_its_log_as_it_did_then():
    device = Positioner(recorded("base", "base")[1], VirtualClock())
    samples = [device.receive(datagram) for datagram in everything("base", "base")]
    assert len(samples) == 20
    assert samples[-1].q[:3].tolist() == [-0.2378512089134768, 0.14951126562184167, 0.3694104196427082]


def test_a_force_sensor_connected_to_its_log_says_what_it_said_then(files):
    clock, transport = recorded("ft-ff", "ft/FF")
    tip = load_fingertips(files["fingertips"])["FF"]
    sensor = Nano17("FF", transport, clock, tip, Nano17Settings())
    sensor.connect()
    samples = sensor.poll()
    clock.sleep_until_ns(10**12)
    samples += sensor.poll()
    assert len(samples) == 27
    assert samples[0].sent == 1
    assert samples[-1].wrench.tolist() == [-0.325, 0.003125, 0.25625, 0.000781, -0.004453, 0.001188]
    assert transport.as_then
    assert len(transport.sent) == 2  # stop an old stream, start ours
    with pytest.raises(DeviceError, match="the recording has ended"):
        sensor.poll()


def test_a_camera_sees_what_it_saw_then():
    (datagram,) = everything("camera", "camera")
    frame = Camera(recorded("camera", "camera")[1], VirtualClock()).receive(datagram)
    assert frame.image.shape == (480, 640)
    assert int(frame.image.sum()) == 40670798


@pytest.mark.parametrize("speed", [1.0, 4.0])
def test_messages_come_when_they_came_then_or_so_many_times_faster(speed):
    clock, transport = recorded("base", "base", speed)
    arrived = []
    for step in range(21):
        clock.sleep_until_ns(step * 10_000_000)
        if len(arrived) == 20:
            break
        arrived += transport.receive()
        expected = min(20, 1 + int(step * speed))
        assert abs(len(arrived) - expected) <= speed
    assert [one.stamp_ns for one in arrived] == sorted(one.stamp_ns for one in arrived)


def test_sending_something_else_than_then_shows():
    _, transport = recorded("ft-ff", "ft/FF")
    transport.send(b"nonsense")
    assert not transport.as_then


def test_the_guides_example_runs(monkeypatch):
    guide = (REPOSITORY / "docs" / "sessions.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"^## A driver on recorded traffic$.*?^```python\n(.*?)^```$", guide, re.M | re.S)
    monkeypatch.chdir(REPOSITORY)
    names = {}
    exec(example, names)  # its own assertions are the test
    assert len(names["link"].sent) == 2


def test_a_device_that_never_answered_and_one_that_was_never_asked_are_links_too():
    said = [
        TrafficMessage(transmitted_topic("base"), b"where are you?", 1_000, 1_000),
        TrafficMessage(received_topic("camera"), b"a picture", 5_000, 5_000),
    ]
    clock = VirtualClock()
    links = recorded_links(SimpleNamespace(messages=lambda: iter(said)), clock)
    assert list(links) == ["base", "camera"]
    links["base"].send(b"where are you?")
    assert links["base"].as_then
    links["camera"].send(b"")
    clock.sleep_until_ns(4_000)
    assert [one.payload for one in links["camera"].receive()] == [b"a picture"]


@pytest.mark.parametrize("log", ["hand", "base", "ft-ff", "biotac-hand", "camera", "format-1"])
def test_every_log_is_small_and_whole(log):
    path = LOGS / f"{log}.mcap"
    assert path.stat().st_size < 60_000
    reader = TrafficReader(path)
    assert list(reader.messages())
    assert not reader.loss
