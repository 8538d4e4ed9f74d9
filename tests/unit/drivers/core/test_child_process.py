"""A module in a process of its own: started, ordered, heard, ended."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.core.child_process import ChildProcess
from drivers.core.errors import DeviceError

CHILD = """
import os, sys, time
from drivers.core.child_process import errors_said, say
from drivers.core.orders import OrderReader
from drivers.core.errors import DeviceError

orders = OrderReader(sys.stdin.fileno())
with errors_said():
    first = orders.first()
    if "fail" in first:
        raise DeviceError(first["fail"])
    say({"ready": True, "group": os.getpgid(0)})
    ended = False
    while not ended:
        for order in orders.waiting(1.0):
            if "sleep_s" in order:
                time.sleep(order["sleep_s"])
            if "echo" in order:
                for word in order["echo"]:
                    say({"word": word})
            if "end" in order:
                ended = True
    say({"last": "words"})
"""
PATIENCE_s = 60.0


@pytest.fixture
def child(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ChildProcess]:
    (tmp_path / "child_under_test.py").write_text(CHILD)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    child = ChildProcess("child_under_test", "echo")
    yield child
    child.kill()


def test_a_child_answers_in_order_and_its_last_words_come_with_its_end(child: ChildProcess) -> None:
    child.start({"go": True})
    ready = child.ready(PATIENCE_s)
    assert child.started
    assert child.running
    assert ready == {"ready": True, "group": child.process_id}, "Ctrl+C goes to the session's group alone"
    child.give({"echo": ["a", "b", "c"]})
    assert [child.answer(PATIENCE_s)["word"] for _ in range(3)] == ["a", "b", "c"]
    assert child.hear() is None, "nothing more was said"
    assert child.close(PATIENCE_s) == b'{"last": "words"}\n'
    assert child.close() == b""
    assert not child.started


def test_a_child_that_fails_says_why_and_is_closed(child: ChildProcess) -> None:
    child.start({"fail": "no such thing"})
    with pytest.raises(DeviceError, match="echo: no such thing"):
        child.ready(PATIENCE_s)
    assert not child.started


def test_a_child_that_was_killed_is_told_and_can_be_started_again(child: ChildProcess) -> None:
    child.start({"go": True})
    child.ready(PATIENCE_s)
    os.kill(child.process_id, signal.SIGKILL)
    with pytest.raises(DeviceError, match="echo: its process has ended"):
        child.answer(PATIENCE_s)
    assert not child.running
    with pytest.raises(DeviceError, match="echo: its process has ended"):
        child.give({"echo": ["x"]})
    child.kill()
    child.start({"go": True})
    assert child.ready(PATIENCE_s)["ready"]


def test_a_busy_child_does_not_hold_up_orders_and_is_killed_when_it_does_not_end(child: ChildProcess) -> None:
    child.start({"go": True})
    child.ready(PATIENCE_s)
    child.give({"sleep_s": 600.0})
    with pytest.raises(DeviceError, match="echo: its process does not answer"):
        child.answer(0.0)
    with pytest.raises(DeviceError, match="echo: its process accepts no commands"):
        child.give({"echo": ["x" * 100_000]})
    assert child.close(0.0) == b""


def test_what_is_not_started_says_so(child: ChildProcess) -> None:
    with pytest.raises(DeviceError, match="echo: not connected"):
        child.give({})
    with pytest.raises(DeviceError, match="echo: not connected"):
        child.read(0.0)
