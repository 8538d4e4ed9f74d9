"""A guided session with page and viewers is, but for measured times, byte for byte the one that nobody watches."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sessions.recording.session import Session
from tactile_lab import process_feed
from tests.support.watched_sessions import PATIENCE_s, guided

pytestmark = pytest.mark.long


MEASURED_SECONDS = re.compile(rb'"seconds":[0-9.e-]+')
"""What the estimation took, in the messages of its state."""


def recorded(folder: Path) -> list[tuple[str, bytes, int]]:
    traffic = Session.open(folder).traffic()
    messages = [
        (message.topic, MEASURED_SECONDS.sub(b"", message.data), message.stamp_ns) for message in traffic.messages()
    ]
    assert not traffic.loss
    return messages


def test_a_watched_guided_session_records_what_an_unwatched_one_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Page and server together, with one viewer that reads and one that does not."""
    monkeypatch.setattr(process_feed, "START_TIMEOUT_s", PATIENCE_s)
    alone = guided(tmp_path / "alone", "sim", 1, watched=False)
    watched = guided(tmp_path / "watched", "sim", 1, watched=True)
    assert watched.counts == alone.counts
    assert watched.counts["overruns"] == 0
    assert watched.counts["grasps"] == 1
    assert watched.received > 100
    assert recorded(watched.folder) == recorded(alone.folder)
