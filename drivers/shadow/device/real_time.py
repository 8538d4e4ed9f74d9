"""Real-time scheduling of a process, where the system permits it."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PRIORITY = 80
SESSION_PRIORITY = 20
SWITCH_INTERVAL_s = 1e-4


_THIS_THREAD = 0


def threads() -> list[int]:
    """Every thread of this process, by number; a library may have started some."""
    return [int(task.name) for task in Path("/proc/self/task").iterdir()]


def request_real_time(priority: int = PRIORITY, of: Iterable[int] = (_THIS_THREAD,)) -> str:
    """Ask for the real-time scheduler, for these threads; what came of it, in words."""
    try:
        for thread in of:
            with suppress(ProcessLookupError):  # it has just ended
                os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
    except PermissionError:
        return "normal scheduling: no permission for SCHED_FIFO (grant it with an rtprio line in limits.conf)"
    return f"SCHED_FIFO, priority {priority}"


@contextmanager
def prefer(priority: int = SESSION_PRIORITY) -> Iterator[str]:
    """Let the cycle of a session that also computes come first while the context lasts; what came of it, in words.

    Threads that it starts meanwhile are scheduled as usual: the kernel puts all real-time programs of a core aside
    for a twentieth of each second when they use it up, and computing would take the hand's process along. They hand
    the interpreter's lock over sooner than usual: a cycle gives it up at each of its many system calls, and would
    else wait 5 ms each time to have it back.
    """
    interval_s = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_INTERVAL_s)
    try:
        yield _take_turns(os.SCHED_RR | os.SCHED_RESET_ON_FORK, priority)
    finally:
        sys.setswitchinterval(interval_s)
        _take_turns(os.SCHED_OTHER, 0)


def _take_turns(policy: int, priority: int) -> str:
    try:
        os.sched_setscheduler(0, policy, os.sched_param(priority))
    except PermissionError:
        return "normal scheduling of the session's cycle"
    return f"round-robin scheduling of the session's cycle, priority {priority}"
