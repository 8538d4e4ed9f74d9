"""Real-time scheduling of a process, where the system permits it."""

from __future__ import annotations

import os

PRIORITY = 80


def request_real_time(priority: int = PRIORITY) -> str:
    """Ask for the real-time scheduler; what came of it, in words."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except PermissionError:
        return "usual scheduling: no right to SCHED_FIFO (grant it with an rtprio line in limits.conf)"
    return f"SCHED_FIFO, priority {priority}"
