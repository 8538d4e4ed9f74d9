"""The page: what it shows, who may see it, and that nothing it does holds up a session."""

from __future__ import annotations

import json
import os
import signal
import socket
import stat
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from gtsam import Pose3, Rot3
from typer import BadParameter

from drivers.core.contacts import Contact, Grasp
from drivers.core.errors import ConfigurationError
from drivers.shadow.model.kinematics import joint_vector, palm_T_distal
from sessions.guided.operator import Ask
from sessions.recording.recorder import Level, Recorder
from sessions.recording.running_session import create_session
from sessions.recording.traffic import schemas
from tactile_lab import process_feed
from tactile_lab.cli.running.page_address import PageAddress
from tactile_lab.process_feed import QUEUE_LENGTH
from tactile_lab.view.controls import details_html, history_html, status_html
from tactile_lab.view.drawing import patches
from tactile_lab.view.feed import ViewFeed
from tactile_lab.view.gate import Gate, Head, is_loopback, new_token, parse_head
from tactile_lab.view.inner_door import InnerDoor
from tactile_lab.view.page import Page
from tactile_lab.view.scene import CAMERA_PACKETS, Scene, ellipse
from tactile_lab.view.skeleton import bones
from tests.support.repository import REPOSITORY

SQUARE = [[-0.02, -0.02, 0.0], [0.02, -0.02, 0.0], [0.02, 0.02, 0.0], [-0.02, 0.02, 0.0]]


class SceneSink:
    """A recording that only feeds a scene."""

    def __init__(self) -> None:
        self.scene = Scene()

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        self.scene.take(topic, data, stamp_ns)


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """A page takes some seconds of processor time to start, of which a busy machine gives it little."""
    monkeypatch.setattr(process_feed, "START_TIMEOUT_s", 600.0)


def contact(finger: str, x: float) -> Contact:
    return Contact(finger, np.array([x, 0.0, 0.02]), np.array([1.0, 0.0, 0.0]), 1e-6 * np.eye(3), 0.05, 0.5)


def recorded(grasps: int = 2) -> Scene:
    sink = SceneSink()
    recorder = Recorder(sink)
    palm = Pose3(Rot3.Yaw(0.3), np.array([0.0, 0.0, 0.2]))
    recorder.frames(1, {"palm": palm, "FF": Pose3(Rot3(), np.array([0.04, 0.0, 0.05]))})
    recorder.loads(2, {"FF": 0.4, "TH": float("inf")})
    for index in range(grasps):
        recorder.grasp(3, Grasp(index, 3, (contact("FF", 0.03), contact("TH", -0.03)), palm), {})
        pose = Pose3(Rot3.Yaw(0.1), np.array([0.01, 0.0, 0.02]))
        state = {"index": index, "verdict": "tracked", "reason": "contacts placed to 1 mm"}
        recorder.slam(4, pose, state, np.diag([1e-6, 4e-6, 1e-4]))
    surface = {"dimension": 2, "vertices_m": SQUARE, "faces": [], "sigma_m": [0.001] * 4, "explored": 0.5}
    recorder.surface(5, {**surface, "origin_height_m": 0.02})
    plan = {"index": 2, "closing": "radial", "x_m": 0.0, "y_m": 0.0, "yaw_rad": 0.2, "height_m": 0.022, "reason": "new"}
    recorder.plan(6, plan)
    recorder.guide(7, {"grasp": 3, "stage": "guide", "prompt": "Move <the> hand", "paused": "coffee", "view": {}})
    recorder.log(8, Level.INFO, "guide", "note: hello")
    return sink.scene


def test_scene_is_put_together_from_what_is_recorded() -> None:
    scene = recorded()
    assert scene.world_T_palm is not None
    assert scene.world_T_palm.z() == pytest.approx(0.2)
    assert scene.loads_N == {"FF": 0.4, "TH": None}
    assert [grasp.index for grasp in scene.grasps] == [0, 1]
    points_m = scene.grasps[1].points_object_m
    assert points_m is not None
    assert points_m.shape == (2, 3)
    assert scene.surface is not None
    assert scene.surface.explored == 0.5
    assert scene.changed == {"hand", "grasps", "object", "plan", "guide"}


def test_grasp_taken_back_is_shown_no_longer() -> None:
    scene = recorded(grasps=3)
    scene.take(schemas.SLAM_STATE_TOPIC, b'{"index": 0, "verdict": "first", "reason": "again"}', 9)
    assert [grasp.index for grasp in scene.grasps] == [0]
    assert list(scene.steps) == [0]


@pytest.mark.parametrize("content", [b"not json", b"{}", b'{"transforms": [{"child_frame_id": "palm"}]}', b"[]"])
def test_messages_of_another_form_are_refused(content: bytes) -> None:
    with pytest.raises(ValueError, match=r"."):
        Scene().take(schemas.TRANSFORMS_TOPIC, content, 1)


def test_topics_that_are_not_shown_change_nothing() -> None:
    scene = Scene()
    scene.take("/link/hand/rx", b"\x00\x01", 5)
    assert not scene.changed


def test_panel_tells_prompt_pause_pose_and_grasps_and_shows_no_foreign_markup() -> None:
    scene = recorded()
    text = status_html(scene)
    assert "Move &lt;the&gt; hand" in text
    assert "Paused: coffee" in text
    assert "10, 0 mm, 6°" in details_html(scene)
    assert "TH silent" in text
    assert history_html(scene).count("tracked: contacts placed to 1 mm") == 2


def test_outline_is_shown_as_a_wall_coloured_by_its_uncertainty() -> None:
    scene = recorded()
    assert scene.surface is not None
    (wall,) = patches(scene.surface)
    assert len(wall.faces) == 8
    assert wall.vertices_m[:, 2].min() == pytest.approx(-0.02)
    assert wall.vertices_m[:, 2].max() == pytest.approx(0.02)
    scene.surface.sigma_m[:] = [0.0, 0.0, 0.02, 0.02]
    known, between, unknown = patches(scene.surface)
    assert sum(len(patch.faces) for patch in (known, between, unknown)) == 8
    assert known.colour[0] < unknown.colour[0]  # from dark violet to yellow


def test_ellipse_has_the_axes_of_the_covariance() -> None:
    outline_m = ellipse(np.diag([1e-6, 4e-6, 1.0]))
    np.testing.assert_allclose(np.abs(outline_m).max(axis=0), [0.002, 0.004], rtol=1e-2)


def test_plan_is_shown_until_its_grasp_is_measured() -> None:
    assert recorded(grasps=2).next_plan["closing"] == "radial"
    assert recorded(grasps=3).next_plan == {}


def test_the_panel_says_what_may_be_believed_of_the_newest_estimate_only() -> None:
    sink = SceneSink()
    recorder = Recorder(sink)
    trust = {
        "status": "ambiguous",
        "known_share": 0.62,
        "doubts": ["the slip before grasp 2 is <improbable>"],
        "alternatives": ["grasp 2 turned by 60° and moved by 30 mm (12%)"],
    }
    recorder.slam(1, Pose3(), {"index": 0, **trust}, np.eye(3))
    shown = status_html(sink.scene) + details_html(sink.scene)
    assert "Ambiguous, 62% of the shape touched" in shown
    assert "&lt;improbable&gt;" in shown
    assert "turned by 60°" in shown
    recorder.slam(2, Pose3(), {"index": 1, "status": "complete", "known_share": None}, np.eye(3))
    shown = status_html(sink.scene) + details_html(sink.scene)
    assert "Complete<" in shown
    assert "improbable" not in shown
    recorder.slam(3, Pose3(), {"index": 2}, np.eye(3))
    assert "Complete" not in status_html(sink.scene)


def test_fingers_bend_where_their_bones_meet() -> None:
    joints_rad = joint_vector({"FFJ3": 0.4, "FFJ2": 0.7, "FFJ1": 0.3, "MFJ2": 0.2})
    lines_m = bones(Pose3(), palm_T_distal(joints_rad))
    assert lines_m.shape == (15, 2, 3)
    knuckle_m, elbow_m = lines_m[0]
    np.testing.assert_allclose(elbow_m - knuckle_m, [0.0, -0.045 * np.sin(0.4), 0.045 * np.cos(0.4)], atol=1e-6)
    assert bones(Pose3(), {}).shape == (0, 2, 3)


# --- the door ------------------------------------------------------------------------------------------------------

TOKEN = "0123456789abcdef"


def head(path: str = "/", **headers: str) -> Head:
    return Head(path, {"host": "127.0.0.1:8090", **headers})


def gate(token: str = "") -> Gate:
    return Gate(frozenset({"127.0.0.1", "localhost"}), token)


def test_visitor_of_the_own_page_passes() -> None:
    assert gate().verdict(head(origin="http://127.0.0.1:8090"))[0] is HTTPStatus.OK


@pytest.mark.parametrize(
    "asked",
    [
        head(origin="http://evil.example"),
        Head("/", {"host": "evil.example:8090"}),
        Head("/", {}),
        head(origin="null"),
    ],
)
def test_other_web_sites_in_the_same_browser_are_refused(asked: Head) -> None:
    assert gate().verdict(asked)[0] is HTTPStatus.FORBIDDEN


def test_other_computers_reach_a_page_by_any_name_but_never_without_the_token() -> None:
    door = Gate(None, TOKEN)
    for host in ("lab-pc:8090", "192.168.7.2:8090", "[fe80::1]:8090"):
        assert door.verdict(Head("/", {"host": host}))[0] is HTTPStatus.FORBIDDEN
        assert door.verdict(Head("/", {"host": host, "cookie": f"tactile_lab_token={TOKEN}"}))[0] is HTTPStatus.OK
        foreign = {"host": host, "cookie": f"tactile_lab_token={TOKEN}", "origin": "http://evil.example"}
        assert door.verdict(Head("/", foreign))[0] is HTTPStatus.FORBIDDEN


def test_the_secret_of_the_inner_door_is_this_program_s_and_no_visitor_s() -> None:
    door = InnerDoor()
    visited = b"GET / HTTP/1.1\r\nHost: a\r\nx-tactile-lab-door: guessed\r\n\r\n"
    head = parse_head(door.marked(visited))
    assert head is not None
    assert head.headers["x-tactile-lab-door"] not in ("", "guessed")
    assert head.headers["host"] == "a"
    assert stat.S_IMODE(door.path.parent.stat().st_mode) == 0o700
    door.close()
    assert not door.path.parent.exists()


def test_token_is_asked_for_once_and_then_in_the_cookie() -> None:
    door = gate(TOKEN)
    assert door.verdict(head())[0] is HTTPStatus.FORBIDDEN
    assert door.verdict(head("/?token=wrong"))[0] is HTTPStatus.FORBIDDEN
    status, cookie = door.verdict(head(f"/?token={TOKEN}"))
    assert status is HTTPStatus.SEE_OTHER
    assert "HttpOnly" in cookie
    assert door.verdict(head(cookie=f"a=b; {cookie.partition(';')[0]}"))[0] is HTTPStatus.OK
    assert door.verdict(head(cookie="tactile_lab_token=wrong"))[0] is HTTPStatus.FORBIDDEN


def test_pages_of_two_sessions_stay_open_in_one_browser() -> None:
    """It keeps one cookie of a name for all ports of a computer."""
    doors, kept = [gate(TOKEN), gate(TOKEN[::-1])], dict[str, str]()
    for door, token in zip(doors, (TOKEN, TOKEN[::-1]), strict=True):
        name, _, value = door.verdict(head(f"/?token={token}"))[1].partition(";")[0].partition("=")
        kept[name] = value
    cookie = "; ".join(f"{name}={value}" for name, value in kept.items())
    assert [door.verdict(head(cookie=cookie))[0] for door in doors] == [HTTPStatus.OK, HTTPStatus.OK]


@pytest.mark.parametrize("data", [b"", b"\x00\xff\r\n\r\n", b"POST / HTTP/1.1\r\n\r\n", b"GET /\r\n\r\n"])
def test_what_is_no_page_request_is_none(data: bytes) -> None:
    assert parse_head(data) is None


def test_loopback_is_told_from_the_rest() -> None:
    assert [is_loopback(name) for name in ("127.0.0.1", "::1", "localhost", "0.0.0.0", "lab.example")] == [
        *(True, True, True, False, False)
    ]


def test_other_addresses_need_a_token() -> None:
    with pytest.raises(ConfigurationError, match="at least 16"):
        PageAddress("0.0.0.0", 8090, "short").check()
    for address in ("0.0.0.0", "127.0.0.1"):
        assert len(PageAddress(address, 8090, "new").check()[2]) >= 16
        assert PageAddress(address, 8090, "").check()[2] != PageAddress(address, 8090, "").check()[2]
    with pytest.raises(BadParameter, match="needs --view"):
        PageAddress.if_wanted(False, "0.0.0.0", 8090, "")
    with pytest.raises(ConfigurationError, match="a token is needed"):
        Page("0.0.0.0", 0, "", "test")


# --- the page itself ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def page() -> Iterator[ViewFeed]:
    with ViewFeed("127.0.0.1", 0, TOKEN, "test") as opened:
        yield opened


def fetch(url: str, **headers: str) -> tuple[int, bytes]:
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=20) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as error:
        return error.code, error.read()


def test_page_is_served_to_whoever_has_the_token(page: ViewFeed) -> None:
    bare = page.url.partition("?")[0]
    assert fetch(bare)[0] == 403
    assert fetch(bare, Cookie="tactile_lab_token=no")[0] == 403
    status, body = fetch(bare, Cookie=f"tactile_lab_token={TOKEN}")
    assert status == 200
    assert b"<html" in body.lower()


@pytest.mark.parametrize("cookie", ["", "Cookie: tactile_lab_token=wrong\r\n"])
def test_no_websocket_is_opened_without_the_token(page: ViewFeed, cookie: str) -> None:
    """A raw client: not one byte of it reaches the page, whatever it sends behind its request."""
    port = urlsplit(page.url).port
    asked = f"GET / HTTP/1.1\r\nHost: localhost:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n{cookie}\r\n"
    with socket.create_connection(("127.0.0.1", port or 0), timeout=20) as client:
        client.sendall(asked.encode() + b"\x82\x05press" * 100)
        answered = client.makefile("rb").read()
    assert answered.startswith(b"HTTP/1.1 403")
    assert answered.count(b"HTTP/1.1") == 1


def test_page_is_drawn_again_and_again_makes_no_tunnel_and_is_reached_through_its_door_only() -> None:
    """In a process of its own: viser leaves its event loop unclosed. What it warns of counts as an error."""
    code = """
import os, socket
from viser import _messages
from tactile_lab.view.page import Page
from tests.unit.tactile_lab.view.test_view import recorded
with Page("127.0.0.1", 0, "", "test") as page:
    for grasps in (1, 2, 1):
        page.scene = recorded(grasps)
        page.draw()
        page.scene.surface.sigma_m[:] = 0.001 * grasps
        page.scene.changed.add("object")
        page.draw()
    print(_messages.ShareUrlRequest in page._inner._websock_server._incoming_handlers)
    listening = [line.split() for line in open("/proc/net/tcp").readlines()[1:]]
    files = (f"/proc/self/fd/{number}" for number in os.listdir("/proc/self/fd"))
    own = {os.readlink(file) for file in files if os.path.exists(file)}
    print(sum(f"socket:[{line[9]}]" in own for line in listening if line[3] == "0A"))
    with socket.socket(socket.AF_UNIX) as stranger:
        stranger.connect(str(page._inner_door.path))
        stranger.sendall(b"GET / HTTP/1.1\\r\\nHost: localhost\\r\\n\\r\\n")
        print(stranger.recv(100).split(b" ")[1].decode())
    place = page._inner_door.path
print(place.exists())
"""
    words = [sys.executable, "-W", "error::UserWarning", "-c", code]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300, check=False, cwd=REPOSITORY)
    assert done.returncode == 0, done.stderr
    tunnels, ports, status, left = done.stdout.split()[-4:]
    assert tunnels == "False"
    assert ports == "1"  # the gate's
    assert status == "403"
    assert left == "False"


# --- the feed ------------------------------------------------------------------------------------------------------


def flood(feed: ViewFeed, count: int) -> None:
    loads = json.dumps({"load_N": {"FF": 0.1}, "padding": "x" * 2000}).encode()
    for stamp in range(count):
        feed.write(schemas.LOADS_TOPIC, loads, stamp)


def alive(pid: int | None) -> bool:
    try:
        os.kill(pid or 0, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.usefixtures("quick_children")
def test_stopped_page_costs_messages_and_nothing_else() -> None:
    with ViewFeed("127.0.0.1", 0, "", "test") as feed:
        pid = feed.pid
        assert pid is not None
        os.kill(pid, signal.SIGSTOP)
        flood(feed, 3 * QUEUE_LENGTH)  # returns: nothing waits for the page
        assert feed.dropped > QUEUE_LENGTH
    assert not alive(pid)


@pytest.mark.usefixtures("quick_children")
def test_killed_page_costs_messages_and_nothing_else() -> None:
    with ViewFeed("127.0.0.1", 0, "", "test") as feed:
        pid = feed.pid
        assert pid is not None
        os.kill(pid, signal.SIGKILL)
        flood(feed, 3 * QUEUE_LENGTH)
        assert feed.requests() == []
        assert feed.dropped > 0
    assert not alive(pid)


@pytest.mark.parametrize("way", [signal.SIGKILL, pytest.param(signal.SIGSTOP, marks=pytest.mark.long)])
def test_recording_is_whole_when_its_page_is_killed_or_hangs(tmp_path: Path, way: signal.Signals) -> None:
    session = create_session(tmp_path, rig="sim", rig_description={}, object_name="box")
    with session, ViewFeed("127.0.0.1", 0, "", "test") as feed:
        session.recorder.add_onlooker(feed)
        for stamp in range(3 * QUEUE_LENGTH):
            if stamp == 5:
                assert feed.pid is not None
                os.kill(feed.pid, way)
            session.recorder.log(stamp, Level.INFO, "test", "x" * 2000)
        assert feed.dropped > 0
    assert session.manifest.status == "closed"
    traffic = session.traffic()
    assert sum(message.topic == schemas.LOG_TOPIC for message in traffic.messages()) == 3 * QUEUE_LENGTH
    assert not traffic.loss


def test_what_devices_send_reaches_the_page_of_a_running_session(tmp_path: Path) -> None:
    """The camera's picture comes from there; the page takes no other device's bytes."""

    class Onlooker:
        def __init__(self) -> None:
            self.heard: list[tuple[str, bytes]] = []

        def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
            self.heard.append((topic, data))

    page = Onlooker()
    with create_session(tmp_path, rig="sim", rig_description={}, object_name="box") as session:
        session.recorder.add_onlooker(page)
        session.recorder.on_received("camera", b"picture", 1)
        session.recorder.on_transmitted("hand", b"command", 2)
    assert page.heard == [(CAMERA_PACKETS, b"picture")]
    feed = ViewFeed("127.0.0.1", 0, "", "test")
    assert feed.is_shown(CAMERA_PACKETS, b"picture")
    assert not feed.is_shown(schemas.received_topic("hand"), b"status")


def test_page_says_what_is_pressed_and_nothing_that_it_must_not() -> None:
    feed = ViewFeed("127.0.0.1", 0, "", "test")
    pressed: list[dict[str, Any]] = [
        {"ask": "capture", "text": ""},
        {"ask": "note", "text": "hello"},
        {"ask": "attach", "text": "/etc/passwd"},
        {"ask": "move"},
        {"ask": "fly"},
        {"nothing": 1},
    ]
    for content in pressed:
        feed._on_line(json.dumps(content).encode())
    feed._on_line(b"\xff not json")
    feed._on_line(b"[1]")
    assert [(request.ask, request.text) for request in feed.requests()] == [(Ask.CAPTURE, ""), (Ask.NOTE, "hello")]


@pytest.mark.usefixtures("quick_children")
def test_page_that_can_not_open_is_told() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(ConfigurationError, match="cannot listen"), ViewFeed("127.0.0.1", port, "", "test"):
            pass


def test_tokens_can_not_be_guessed() -> None:
    assert len({new_token() for _ in range(10)}) == 10
    assert len(new_token()) >= 32
