"""Real-time scheduling of threads that a library has started."""

from __future__ import annotations

import os
import threading

import pytest

from drivers.shadow.device.real_time import request_real_time, threads


def is_permitted() -> bool:
    """Whether this process may have real-time scheduling."""
    found: list[str] = []
    trial = threading.Thread(target=lambda: found.append(request_real_time(1)))
    trial.start()
    trial.join()
    return found[0].startswith("SCHED_FIFO")


def test_a_thread_gets_a_priority_of_its_own_and_the_others_keep_theirs() -> None:
    if not is_permitted():
        pytest.skip("no permission for SCHED_FIFO")
    begun, ending = threading.Event(), threading.Event()
    listener = threading.Thread(target=lambda: (begun.set(), ending.wait()))
    listener.start()
    begun.wait()
    try:
        number = listener.native_id
        assert number is not None
        assert {number, threading.get_native_id()} <= set(threads())
        assert request_real_time(7, {number}) == "SCHED_FIFO, priority 7"
        assert (os.sched_getscheduler(number), os.sched_getparam(number).sched_priority) == (os.SCHED_FIFO, 7)
        assert os.sched_getscheduler(0) == os.SCHED_OTHER
    finally:
        ending.set()
        listener.join()


def test_a_thread_that_has_ended_is_no_failure() -> None:
    ended = threading.Thread(target=lambda: None)
    ended.start()
    number = ended.native_id
    ended.join()
    assert number is not None
    assert "SCHED_FIFO" in request_real_time(1, {number})
