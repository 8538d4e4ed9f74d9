"""Injects faults into a wire: a wrapper for any transport, and the kinds of faults.

A wrapper injects one fault and counts how often; wrappers can be nested. The driver's tests define once, in a
:class:`MessageLayout`, what faults need to know of its messages (the positions of counters and values).
"""

from __future__ import annotations

from tests.support.faults.kinds import (
    SLAVE_TO_SAFEOP,
    WORKING_COUNTER_LOW,
    ClockJump,
    CounterWrap,
    Delay,
    Drop,
    Duplicate,
    FarEnd,
    Fault,
    FlipBit,
    Injectable,
    Reorder,
    Saturate,
    StaleSequence,
    StuckValue,
    Truncate,
    Unplug,
    standard_faults,
)
from tests.support.faults.schedule import Field, MessageLayout, When
from tests.support.faults.transport import FaultyTransport

__all__ = [
    "SLAVE_TO_SAFEOP",
    "WORKING_COUNTER_LOW",
    "ClockJump",
    "CounterWrap",
    "Delay",
    "Drop",
    "Duplicate",
    "FarEnd",
    "Fault",
    "FaultyTransport",
    "Field",
    "FlipBit",
    "Injectable",
    "MessageLayout",
    "Reorder",
    "Saturate",
    "StaleSequence",
    "StuckValue",
    "Truncate",
    "Unplug",
    "When",
    "standard_faults",
]
