"""The live page in a real browser: what is pressed reaches the session, and the browser's end changes nothing."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from sessions.guided.operator import Ask, Request
from sessions.recording.recorder import Level
from sessions.recording.running_session import create_session
from sessions.recording.traffic import schemas
from tactile_lab.view.feed import ViewFeed
from tests.support.browser import Browser, chromium, until

TOKEN = "a-token-of-the-tests-0123456789"


@pytest.fixture
def program() -> str:
    found = chromium()
    if found is None:
        pytest.skip("no Chromium on this computer")
    return found


@pytest.fixture
def feed() -> Iterator[ViewFeed]:
    with ViewFeed("127.0.0.1", 0, TOKEN, "test") as opened:
        yield opened


def asked(feed: ViewFeed) -> Request:
    return until(feed.requests, "what was pressed")[0]  # type: ignore[no-any-return]


def test_every_button_that_a_person_presses_reaches_the_session_and_the_recording_outlives_the_page(
    program: str, feed: ViewFeed, tmp_path: Path
) -> None:
    session = create_session(tmp_path / "runs", rig="sim", rig_description={}, object_name="box")
    with session, Browser(program, feed.url, tmp_path / "profile") as browser:
        session.recorder.add_onlooker(feed)
        session.recorder.guide(1, {"grasp": 1, "stage": "hold", "prompt": "Hold the object", "paused": "as asked"})
        until(lambda: browser.shows("Hold the object"), "the prompt")
        assert browser.shows("Paused: as asked")
        for label, ask in (
            ("Capture", Ask.CAPTURE),
            ("Undo", Ask.UNDO),
            ("Pause / resume", Ask.PAUSE),
            ("Pause / resume", Ask.PAUSE),
            ("Next step", Ask.NEXT),
            ("Do it", Ask.GO),
            ("End", Ask.END),
        ):
            browser.press(label)
            assert asked(feed).ask is ask, label
        browser.press("Save note")
        until(lambda: browser.shows("The note is empty"), "that there is no note")
        browser.write("slipped at the edge")
        browser.press("Save note")
        noted = asked(feed)
        assert (noted.ask, noted.text) == (Ask.NOTE, "slipped at the edge")
        assert feed.pid is not None
        os.kill(feed.pid, signal.SIGKILL)  # the page dies while a browser shows it
        for stamp in range(50):
            session.recorder.log(10 + stamp, Level.INFO, "test", "goes on")
    assert session.manifest.status == "closed"
    traffic = session.traffic()
    assert sum(message.topic == schemas.LOG_TOPIC for message in traffic.messages()) == 50
    assert not traffic.loss


def test_a_browser_without_the_token_sees_the_reason_and_presses_nothing(
    program: str, feed: ViewFeed, tmp_path: Path
) -> None:
    with Browser(program, feed.url.partition("?")[0], tmp_path / "profile") as browser:
        until(lambda: browser.shows("the token is missing or wrong"), "the reason")
        assert browser.evaluate("document.querySelectorAll('button').length") == 0
    assert not feed.requests()
