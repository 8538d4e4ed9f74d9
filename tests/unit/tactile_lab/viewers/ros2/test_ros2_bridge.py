"""The bridge to ROS 2: what its topics hold, what its services answer, seen by a DDS participant of the test's own."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Mapping
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from rosbags.typesys import Stores, get_typestore

from drivers.core.clock import NANOSECONDS
from drivers.core.errors import ConfigurationError, ProcessError
from sessions.guided.operator import Ask, Request
from tactile_lab import process_feed
from tactile_lab.viewers.ros2 import opening
from tactile_lab.viewers.ros2.conversion import Conversion, Serialized
from tactile_lab.viewers.ros2.feed import Ros2Feed
from tactile_lab.viewers.ros2.node import Reach
from tactile_lab.viewers.ros2.opening import require_ros2
from tactile_lab.viewers.ros2.services import SERVICES, Services
from tests.support import told_session

STORE = get_typestore(Stores.ROS2_JAZZY)
NOW_ns = 1_800_000_000 * NANOSECONDS
PATIENCE_s = 60.0
DOMAIN = 83


@pytest.fixture(scope="module")
def told() -> list[Serialized]:
    """A whole session as the bridge publishes it."""
    conversion = Conversion("sim", lambda: NOW_ns)
    return [one for topic, data, stamp in told_session.told() for one in conversion.of(topic, data, stamp)]


def decoded(told: list[Serialized], topic: str) -> list[Any]:
    return [STORE.deserialize_cdr(one.data, one.kind) for one in told if one.topic == topic]


# --- topics --------------------------------------------------------------------------------------------------------


def test_all_topics_are_standard_types_and_the_robot_lasts(told):
    assert {one.topic for one in told} == {
        "/camera/camera_info", "/camera/image/compressed", "/candidates", "/contacts/markers", "/contacts/points",
        "/ft/FF/wrench", "/joint_states", "/object/points", "/object/pose", "/object/surface", "/robot_description",
        "/tf", "/tf_static", "/truth/object",
    }  # fmt: skip
    assert {one.topic for one in told if one.lasting} == {"/robot_description", "/tf_static"}
    assert told[0].topic == "/robot_description"


def test_stamps_are_of_the_computer_s_clock_and_keep_their_distances(told):
    states = decoded(told, "/joint_states")
    seconds = [one.header.stamp.sec + one.header.stamp.nanosec / NANOSECONDS for one in states]
    assert seconds[0] == pytest.approx(NOW_ns / NANOSECONDS + 1.0, abs=1e-6)  # the first message is a second older
    assert seconds[1] - seconds[0] == pytest.approx(8.0, abs=1e-6)


def test_wrenches_and_joints_are_those_of_the_session(told):
    (wrench,) = decoded(told, "/ft/FF/wrench")
    assert (wrench.header.frame_id, wrench.wrench.force.z, wrench.wrench.torque.x) == ("rh_ffsensor", 3.0, 4.0)
    joints, base = told_session.posture()
    expected = told_session.robot().positions(joints, base)
    state = decoded(told, "/joint_states")[0]
    assert dict(zip(state.name, state.position, strict=True)) == pytest.approx(expected)


def test_another_session_begins_anew():
    conversion = Conversion("sim", lambda: NOW_ns)
    first = told_session.told()[1]
    topics = [[one.topic for one in conversion.of(*first)] for _ in range(2)]
    conversion.begin_session()
    assert [one.topic for one in conversion.of(*first)] == topics[0] != topics[1]


# --- services ------------------------------------------------------------------------------------------------------


@pytest.fixture
def sent() -> list[Mapping[str, Any]]:
    return []


@pytest.fixture
def services(sent: list[Mapping[str, Any]]) -> Services:
    return Services(sent.append)


def state(*, running: bool, guided: bool = False) -> bytes:
    return json.dumps({"running": running, "guided": guided}).encode()


def panel(stage: str, *asks: str) -> bytes:
    return json.dumps({"stage": stage, "asks": asks}).encode()


def test_nothing_but_a_start_is_accepted_before_a_session_and_a_second_start_is_refused(services, sent):
    for name in set(SERVICES) - {"start"}:
        assert services.call(name) == (False, "no session is running: start one first")
    assert services.call("start")[0]
    assert services.call("start") == (False, "a session is running: stop it first")
    services.on_state(state(running=False))
    assert services.call("start")[0]
    assert sent == [{"ask": "start"}] * 2


def test_an_autonomous_session_is_stopped_paused_and_undone_but_not_stepped(services, sent):
    services.on_state(state(running=True))
    assert [services.call(name)[0] for name in ("undo", "pause", "stop")] == [True, True, True]
    assert [content["ask"] for content in sent] == ["undo", "pause", "end"]
    assert sent[-1]["text"]  # so that a guided session does not ask again
    for name in ("capture", "next", "go"):
        success, text = services.call(name)
        assert (success, "--mode guided" in text) == (False, True)


def test_a_guided_session_captures_only_what_it_holds(services, sent):
    services.on_state(state(running=True, guided=True))
    assert not services.call("capture")[0]
    services.on_panel(panel("guide", "go", "next"))
    assert services.call("capture") == (False, "not at this stage (guide): possible are go, next")
    services.on_panel(panel("hold", "capture", "give up"))
    assert services.call("capture") == (True, "asked to measure the grasp that the hand holds")
    assert [content["ask"] for content in sent] == ["capture"]


def test_what_the_bridge_asks_reaches_the_session_and_nothing_else_does():
    feed = Ros2Feed("sim", Reach(DOMAIN))
    feed.on_press({"ask": "capture"})
    feed.on_press({"ask": "attach", "text": "/etc/passwd"})
    with pytest.raises(ValueError, match="explode"):
        feed.on_press({"ask": "explode"})
    assert feed.requests() == [Request(Ask.CAPTURE)]
    assert feed.requests() == []
    with pytest.raises(ProcessError, match="has ended"):
        feed.wait_for_start(0.0)
    feed.on_press({"ask": "start"})
    assert feed.wait_for_start(0.0)


def test_the_truth_stays_in_the_session():
    feed = Ros2Feed("sim", Reach(DOMAIN))
    shown = {topic for topic, data, _ in told_session.told() if feed.is_shown(topic, data)}
    assert {"/hand/joints", "/slam/pose"} <= shown
    assert "/truth/object" not in shown


# --- without ROS, by Cyclone DDS -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def dds() -> SimpleNamespace:
    """What the test's own participant is made of."""
    pytest.importorskip("cyclonedds", reason="the package cyclonedds is not installed")
    from cyclonedds.domain import Domain, DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic

    from tactile_lab.viewers.ros2.dds_node import LOOPBACK, quality

    return SimpleNamespace(
        Domain=Domain, Participant=DomainParticipant, Reader=DataReader, Writer=DataWriter, Topic=Topic,
        loopback=LOOPBACK, quality=quality,
    )  # fmt: skip


def until(look: Callable[[], Any]) -> Any:
    """What is found at last."""
    begun = time.monotonic()
    while time.monotonic() - begun < PATIENCE_s:
        if found := look():
            return found
        time.sleep(0.02)
    raise AssertionError("nothing came")


class Client:
    """A participant of the test's own, with types of its own.

    Args:
        dds: what it is made of.
        domain: of ROS 2.
    """

    def __init__(self, dds: SimpleNamespace, domain: int) -> None:
        from cyclonedds.idl import make_idl_struct, types

        head = {"client": types.uint64, "number": types.int64}
        self.text = make_idl_struct("String", "std_msgs.msg.dds_.String_", {"data": str})
        self.request = make_idl_struct(
            "Request", "std_srvs.srv.dds_.Trigger_Request_", {**head, "nothing": types.uint8}
        )
        content = {"success": bool, "message": str}
        self.reply = make_idl_struct("Reply", "std_srvs.srv.dds_.Trigger_Response_", {**head, **content})
        self._dds, self._here = dds, dds.Participant(domain)

    def reader(self, name: str, kind: Any, *, lasting: bool = False) -> Any:
        topic = self._dds.Topic(self._here, name, kind)
        return self._dds.Reader(self._here, topic, self._dds.quality(lasting=lasting))

    def call(self, service: str) -> Any:
        """The reply of a service, once there is one of it."""
        replies = self.reader(f"rr/tactile_lab/{service}Reply", self.reply)
        topic = self._dds.Topic(self._here, f"rq/tactile_lab/{service}Request", self.request)
        asking = self._dds.Writer(self._here, topic, self._dds.quality())
        until(lambda: asking.get_publication_matched_status().current_count)
        until(lambda: replies.get_subscription_matched_status().current_count)
        asking.write(self.request(7, 1, 0))
        return until(replies.take)[0]


def test_a_participant_of_another_program_calls_services(dds, services):
    from tactile_lab.viewers.ros2.dds_node import DdsNode
    from tactile_lab.viewers.ros2.dds_types import TriggerReply, TriggerRequest

    services.on_state(state(running=True))
    serving = DdsNode(Reach(DOMAIN))
    try:
        serving.serve("stop", lambda: services.call("stop"))
        serving.serve("capture", lambda: services.call("capture"))
        client = Client(dds, DOMAIN)
        client.request, client.reply = TriggerRequest, TriggerReply  # one process has one type of a name
        accepted, refused = client.call("stop"), client.call("capture")
    finally:
        serving.close()
    assert (accepted.client, accepted.number, accepted.success) == (7, 1, True)
    assert (refused.success, "--mode guided" in refused.message) == (False, True)


@pytest.mark.long
def test_the_bridge_s_process_publishes_a_session_and_hands_requests_to_it(dds, monkeypatch):
    monkeypatch.setattr(process_feed, "START_TIMEOUT_s", PATIENCE_s)
    domain = dds.Domain(DOMAIN + 2, dds.loopback)
    with Ros2Feed("sim", Reach(DOMAIN + 2)) as feed:
        client = Client(dds, DOMAIN + 2)
        assert client.call("start").success
        until(lambda: feed.wait_for_start(0.0))
        feed.begin(guided=False)
        for topic, data, stamp_ns in told_session.told():
            feed.write(topic, data, stamp_ns)
        description = until(client.reader("rt/robot_description", client.text, lasting=True).take)[0]
        assert description.data.startswith("<?xml")
        assert client.call("stop").success
        (stopping,) = until(feed.requests)
        assert stopping.ask is Ask.END
    del domain


def test_every_topic_arrives_as_it_was_serialized(dds, told):
    from tactile_lab.viewers.ros2.dds_node import DdsNode
    from tactile_lab.viewers.ros2.dds_types import message_type

    newest = {one.topic: one for one in told}
    sender = DdsNode(Reach(DOMAIN + 1))
    here = dds.Participant(DOMAIN + 1)
    try:
        for one in newest.values():
            kept = dds.quality(lasting=True)
            reading = dds.Reader(here, dds.Topic(here, f"rt{one.topic}", message_type(one.kind)), kept)
            sender.publish(one.topic, one.kind, one.data, lasting=True)
            message = until(reading.take)[0]
            assert message.serialize(use_version_2=False) == one.data, one.topic  # by Cyclone's own serializer
    finally:
        sender.close()


# --- by ROS 2's own library ----------------------------------------------------------------------------------------


class FakeRos:
    """Stands for ``rclpy`` and the packages of its types; keeps what it was asked for."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.published: list[tuple[str, str, bytes, str]] = []
        self.services: dict[str, Callable[[Any, Any], Any]] = {}
        self.domain, self.closed = -1, 0
        modules = {
            "rclpy": {"init": self._init, "create_node": lambda name, context: self},
            "rclpy.context": {"Context": lambda: SimpleNamespace(try_shutdown=self._close)},
            "rclpy.executors": {"SingleThreadedExecutor": lambda context: self},
            "rclpy.qos": {
                "DurabilityPolicy": SimpleNamespace(TRANSIENT_LOCAL="lasts", VOLATILE="passes"),
                "QoSProfile": lambda depth, durability: durability,
            },
            "std_msgs.msg": {"String": "std_msgs/String"},
            "std_srvs.srv": {"Trigger": "std_srvs/Trigger"},
        }
        for name, content in modules.items():
            module = ModuleType(name)
            module.__dict__.update(content)
            monkeypatch.setitem(sys.modules, name, module)

    def _init(self, context: Any, domain_id: int) -> None:
        self.domain = domain_id

    def _close(self) -> None:
        self.closed += 1

    def create_publisher(self, kind: str, topic: str, quality: str) -> Any:
        return SimpleNamespace(publish=lambda data: self.published.append((topic, kind, data, quality)))

    def create_service(self, kind: str, name: str, answer: Callable[[Any, Any], Any]) -> None:
        self.services[name] = answer

    def add_node(self, node: Any) -> None:
        assert node is self

    def spin(self) -> None:
        """Ends at once."""

    shutdown = destroy_node = _close


def test_where_ros_is_its_own_library_publishes_and_answers(monkeypatch):
    monkeypatch.delenv("ROS_AUTOMATIC_DISCOVERY_RANGE", raising=False)
    monkeypatch.setenv("ROS_DOMAIN_ID", "0")
    ros = FakeRos(monkeypatch)
    monkeypatch.setattr(opening, "has_rclpy", lambda: True)
    with monkeypatch.context() as patch:
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        opened = opening.open_node(Reach(5))
        opened.publish("/x", "std_msgs/msg/String", b"bytes", lasting=True)
        opened.serve("undo", lambda: (False, "no session"))
        response = ros.services["/tactile_lab/undo"](None, SimpleNamespace())
        opened.close()
    assert (ros.domain, ros.closed) == (5, 3)
    assert ros.published == [("/x", "std_msgs/String", b"bytes", "lasts")]
    assert (response.success, response.message) == (False, "no session")


def test_without_either_library_the_extra_is_named(monkeypatch):
    monkeypatch.setattr("drivers.core.installed.extras.find_spec", lambda name: name == "rosbags" or None)
    monkeypatch.setattr(opening, "find_spec", lambda name: None)
    with pytest.raises(ConfigurationError, match=r"cyclonedds of the extra \[ros\]"):
        require_ros2()
