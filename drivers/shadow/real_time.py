"""Real-time scheduling of a process, where the system permits it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

PRIORITY = 80
SESSION_PRIORITY = 20


def request_real_time(priority: int = PRIORITY) -> str:
    """Ask for the real-time scheduler; what came of it, in words."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except PermissionError:
        return "usual scheduling: no right to SCHED_FIFO (grant it with an rtprio line in limits.conf)"
    return f"SCHED_FIFO, priority {priority}"


@contextmanager
def preferred(priority: int = SESSION_PRIORITY) -> Iterator[str]:
    """Let a session come before usual programs while the context lasts; gives what came of it, in words.

    Threads that it starts meanwhile are scheduled alike and take turns with it: one that held the interpreter's lock
    but never got its turn would hold up the session's cycle.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(priority))
    except PermissionError:
        yield "usual scheduling of the session's cycle"
        return
    try:
        yield f"the session's cycle at SCHED_RR, priority {priority}"
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
