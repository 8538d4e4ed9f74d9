"""The live server: what viewers receive, who may connect, and one that does not read."""

from __future__ import annotations

import asyncio
import base64
import json
import socket
import struct
import time
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

import foxglove
import pytest
import typer
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

from drivers.core.errors import ConfigurationError
from tactile_lab import process_feed
from tactile_lab.cli.running.live_address import LIVE_PORT, LiveAddress
from tactile_lab.process_feed import QUEUE_LENGTH
from tactile_lab.viewers.live.door import Door
from tactile_lab.viewers.live.feed import LiveFeed
from tactile_lab.viewers.live.outbox import MOST_PASSING, Outbox
from tactile_lab.viewers.live.server import Viewer
from tests.support import told_session

TOKEN = "t" * 24
PATIENCE_s = 600.0


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine gives the server little of the seconds that it needs to start."""
    monkeypatch.setattr(process_feed, "START_TIMEOUT_s", PATIENCE_s)


@pytest.fixture(scope="module")
def feed() -> Iterator[LiveFeed]:
    """A server that has been told a whole session."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(process_feed, "START_TIMEOUT_s", PATIENCE_s)
        with LiveFeed("sim", "127.0.0.1", 0, TOKEN, "told") as server:
            for topic, data, stamp_ns in told_session.told():
                server.write(topic, data, stamp_ns)
            yield server


@pytest.fixture(autouse=True, scope="module")
def _threads_of_the_feed_begin_before_a_test_counts_them(feed: LiveFeed) -> None:
    """The module's server has threads."""


def received(url: str, wanted: set[str], protocol: str = "foxglove.sdk.v1") -> dict[str, tuple[str, Any]]:
    """Schema and first message of each wanted topic, as any client of the protocol reads them."""
    found: dict[str, tuple[str, Any]] = {}
    with connect(url, subprotocols=[protocol], max_size=None, open_timeout=PATIENCE_s) as viewer:
        assert viewer.subprotocol == protocol
        channels: dict[int, dict[str, Any]] = {}
        while set(found) < wanted:
            frame = viewer.recv(PATIENCE_s)
            if isinstance(frame, str):
                for one in json.loads(frame).get("channels", ()):
                    if one["topic"] in wanted:
                        channels[one["id"]] = one
                        ask = {"op": "subscribe", "subscriptions": [{"id": one["id"] + 100, "channelId": one["id"]}]}
                        viewer.send(json.dumps(ask))
            else:
                operation, subscription, _ = struct.unpack_from("<BIQ", frame)
                assert operation == 1
                channel = channels[subscription - 100]
                found.setdefault(channel["topic"], (channel["schemaName"], decoded(channel, frame[13:])))
    return found


def decoded(channel: dict[str, Any], data: bytes) -> Any:
    """A message by the definition that the server gave."""
    if channel["encoding"] != "protobuf":
        return data
    files = descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(channel["schema"]))
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(channel["schemaName"])).FromString(data)


def test_who_comes_late_receives_everything_that_is_still_true(feed):
    wanted = {
        "/robot_description", "/robot/scene", "/tf_static", "/tf", "/contacts/scene", "/object/surface", "/object/pose",
        "/camera/image", "/candidates",
    }  # fmt: skip
    found = received(feed.url, wanted)
    assert b"<robot" in found["/robot_description"][1]
    kind, surface = found["/object/surface"]
    assert (kind, len(surface.entities[0].triangles[0].points)) == ("foxglove.SceneUpdate", 4)
    assert found["/object/pose"][1].frame_id == "world"
    assert {one.id for one in found["/robot/scene"][1].entities} >= {"rh_palm", "rh_ffdistal", "table"}


def test_the_same_client_reads_foxglove_s_own_server():
    context = foxglove.Context()
    server = foxglove.start_server(host="127.0.0.1", port=0, context=context)
    try:
        channel = foxglove.channels.PoseInFrameChannel("/object/pose", context=context)
        url = f"ws://127.0.0.1:{server.port}"
        with connect(url, subprotocols=["foxglove.sdk.v1"], open_timeout=PATIENCE_s) as viewer:
            told = [json.loads(viewer.recv(PATIENCE_s)) for _ in range(2)]
            assert [one["op"] for one in told] == ["serverInfo", "advertise"]
            (theirs,) = told[1]["channels"]
            viewer.send(json.dumps({"op": "subscribe", "subscriptions": [{"id": 7, "channelId": theirs["id"]}]}))
            while not channel.has_sinks():
                time.sleep(0.01)
            channel.log(foxglove.messages.PoseInFrame(frame_id="world"), log_time=5)
            frame = viewer.recv(PATIENCE_s)
        assert struct.unpack_from("<BIQ", frame) == (1, 7, 5)
        assert decoded(theirs, frame[13:]).frame_id == "world"
    finally:
        server.stop()


def test_our_announcement_has_the_fields_of_foxglove_s_own(feed):
    with connect(feed.url, subprotocols=["foxglove.websocket.v1"], open_timeout=PATIENCE_s) as viewer:
        info, announced = (json.loads(viewer.recv(PATIENCE_s)) for _ in range(2))
    assert (info["op"], info["name"], info["capabilities"]) == ("serverInfo", "told", [])
    assert {frozenset(one) for one in announced["channels"]} == {
        frozenset({"id", "topic", "encoding", "schemaName", "schema", "schemaEncoding"})
    }


def test_the_truth_is_not_for_those_who_watch(feed):
    with connect(feed.url, subprotocols=["foxglove.sdk.v1"], open_timeout=PATIENCE_s) as viewer:
        _, announced = (json.loads(viewer.recv(PATIENCE_s)) for _ in range(2))
    assert not [one["topic"] for one in announced["channels"] if "truth" in one["topic"]]


@pytest.mark.parametrize(
    ("origin", "token", "words"),
    [
        (None, "wrong", "token is missing or wrong"),
        (None, "", "token is missing or wrong"),
        ("https://evil.example", TOKEN, "another web site, https://evil.example"),
        ("http://localhost.evil.example", TOKEN, "another web site"),
        ("http://[", TOKEN, "another web site"),
    ],
)
def test_strangers_are_refused_in_one_sentence(feed, origin, token, words):
    url = feed.url.partition("?")[0] + f"?token={token}"
    with pytest.raises(InvalidStatus) as refused, connect(url, origin=origin, open_timeout=PATIENCE_s):
        pass
    answer = refused.value.response
    assert answer.status_code == 403
    assert words in answer.body.decode()
    assert answer.body.decode().count("\n") == 1


def test_a_token_in_no_encoding_is_a_wrong_one(feed):
    with socket.create_connection(("127.0.0.1", urlsplit(feed.url).port), timeout=PATIENCE_s) as raw:
        raw.sendall(b"GET /?token=\xe9 HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert raw.recv(4096).startswith(b"HTTP/1.1 403 ")


@pytest.mark.parametrize(
    "origin", ["https://app.foxglove.dev", "http://localhost:8080", "file://", "https://lab.example"]
)
def test_known_viewers_are_let_in(origin):
    assert Door(TOKEN, "https://lab.example/").problem(f"/?token={TOKEN}", origin) == ""


def test_requests_that_are_none_are_ignored(feed):
    with connect(feed.url, subprotocols=["foxglove.sdk.v1"], open_timeout=PATIENCE_s) as viewer:
        for text in (
            "",
            "[]",
            "{}",
            '{"op":"subscribe"}',
            '{"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]}',
            '{"op":"subscribe","subscriptions":[{"id":1e999,"channelId":1}]}',
            60_000 * "[",
        ):
            viewer.send(text)
        viewer.send(b"\x01binary")
        viewer.send('{"op":"unsubscribe","subscriptionIds":[5]}')
        assert viewer.ping().wait(PATIENCE_s)  # it is still connected
    assert received(feed.url, {"/tf_static"})


def test_a_viewer_that_does_not_read_delays_neither_the_session_nor_others(feed):
    with stuck(feed) as _:
        _, data, stamp_ns = next(one for one in told_session.told() if one[0] == "/hand/joints")
        for number in range(3 * QUEUE_LENGTH):
            feed.write("/hand/joints", data, stamp_ns + number)  # returns: nothing waits
        assert received(feed.url, {"/joint_states"})


def stuck(feed: LiveFeed) -> ClientConnection:
    """A viewer that subscribes to everything and never reads again."""
    viewer = connect(
        feed.url, subprotocols=["foxglove.sdk.v1"], max_queue=1, open_timeout=PATIENCE_s, close_timeout=0.1
    )
    asked = [{"id": number, "channelId": number} for number in range(1, 30)]
    viewer.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
    return viewer


def test_of_what_passes_the_oldest_gives_way_and_of_what_lasts_the_newest_stays():
    outbox = Outbox()
    outbox.put(b"surface 1", ("/object/surface", ""))
    for number in range(MOST_PASSING + 3):
        outbox.put(b"%d" % number)
    outbox.put(b"surface 2", ("/object/surface", ""))
    frames = []
    while outbox._waiting:
        frames.append(run(outbox.take()))
    assert outbox.left_out == 3
    assert frames == [*(b"%d" % number for number in range(3, MOST_PASSING + 3)), b"surface 2"]


def test_a_viewer_that_was_too_slow_is_told_how_many_messages_it_missed():
    sent: list[str | bytes] = []

    class Connection:
        async def send(self, frame: str | bytes) -> None:
            sent.append(frame)

    async def drain(viewer: Viewer) -> None:
        writing = asyncio.create_task(viewer.write())
        while len(sent) < MOST_PASSING + 1:
            await asyncio.sleep(0)
        writing.cancel()

    viewer = Viewer(Connection())  # type: ignore[arg-type]
    for number in range(MOST_PASSING + 3):
        viewer.outbox.put(b"%d" % number)
    asyncio.run(drain(viewer))
    (told,) = (json.loads(frame) for frame in sent if isinstance(frame, str))
    assert (told["op"], told["level"]) == ("status", 1)
    assert "3 messages were left out; all are recorded" in told["message"]


def run(work: Any) -> Any:
    """The result of a coroutine that need not wait."""
    try:
        work.send(None)
    except StopIteration as ended:
        return ended.value
    raise AssertionError("it waits")


@pytest.mark.usefixtures("quick_children")
def test_a_port_that_is_taken_is_said_in_one_sentence(feed):
    port = int(feed.url.split(":")[2].partition("/")[0])
    with (
        pytest.raises(ConfigurationError, match=r"cannot listen on 127\.0\.0\.1:") as refused,
        LiveFeed("sim", "127.0.0.1", port, TOKEN, "second"),
    ):
        pass
    assert "Choose another --live-port" in str(refused.value)


@pytest.mark.parametrize(("port", "origin"), [(1, ""), (LIVE_PORT, "https://lab.example")])
def test_options_of_the_server_need_the_server(port, origin):
    with pytest.raises(typer.BadParameter, match="needs --live"):
        LiveAddress.if_wanted(False, "sim", port, "", origin)
    assert LiveAddress.if_wanted(False, "sim", LIVE_PORT, "", "") is None


@pytest.mark.parametrize(
    "origin", ["lichtblick.example.org", "https://", "lab:8080", "https://lab.example/viewer", "http://["]
)
def test_an_origin_that_no_browser_sends_is_refused(origin):
    with pytest.raises(typer.BadParameter, match=r"https://lichtblick\.example\.org"):
        LiveAddress.if_wanted(True, "sim", LIVE_PORT, "", origin)


@pytest.mark.parametrize(
    "origin", ["https://lab.example", "https://lab.example/", "http://lab:8080", "http://[::1]:80"]
)
def test_an_origin_is_a_scheme_and_a_name(origin):
    wanted = LiveAddress.if_wanted(True, "sim", LIVE_PORT, "", origin)
    assert wanted is not None
    assert wanted.origin == origin
