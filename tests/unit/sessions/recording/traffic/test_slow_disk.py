"""Closing a recording on a slow disk: it is given the time it needs, and given up once it writes nothing."""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path

import pytest

from drivers.core.errors import SessionError
from sessions.recording.traffic import writer as traffic
from sessions.recording.traffic.disk import CutBackFile
from sessions.recording.traffic.reader import TrafficReader
from sessions.recording.traffic.settings import TrafficSettings

PATIENCE_s = 1.0
"""A busy machine may not let the disk's thread run for half a second."""
MESSAGES = 20


class Slow(CutBackFile):
    """Each piece takes a while, less than anybody waits; all together take several times as long."""

    def write(self, data: bytes) -> int:
        time.sleep(PATIENCE_s / 20)
        return super().write(data)


class Stuck(CutBackFile):
    """Writes nothing more until it is let go."""

    free = threading.Event()

    def write(self, data: bytes) -> int:
        if self.tell() > 100_000:
            self.free.wait()
        return super().write(data)


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    monkeypatch.setattr(traffic, "CLOSE_TIMEOUT_s", PATIENCE_s)


def recording(path: Path, kind: type[CutBackFile]) -> traffic.TrafficWriter:
    """A recording whose chunks wait for the disk."""
    writer = traffic.TrafficWriter(path, settings=TrafficSettings(open_file=kind))
    for number in range(MESSAGES):
        writer.write("/link/hand/rx", os.urandom(traffic.CHUNK_BYTES), number)
    return writer


def test_everything_is_written_however_long_it_takes(tmp_path):
    begun, writer = time.monotonic(), recording(tmp_path / "t.mcap", Slow)
    writer.settle()
    writer.close()
    assert time.monotonic() - begun > PATIENCE_s
    reader = TrafficReader(tmp_path / "t.mcap")
    assert sum(message.topic == "/link/hand/rx" for message in reader.messages()) == MESSAGES
    assert not reader.loss


def test_a_disk_that_writes_nothing_is_given_up(tmp_path):
    writer = recording(tmp_path / "t.mcap", Stuck)
    try:
        with pytest.raises(SessionError, match=r"written nothing for 1 s"):
            writer.close()
    finally:
        Stuck.free.set()
