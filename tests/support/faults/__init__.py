"""Things that go wrong on a wire, on purpose: a wrapper around any transport, and the faults it can inject.

One wrapper injects one fault and counts how often; wrappers can be nested. What a fault must know of a driver's
messages (where its counters and values stand) is said once by the driver's tests in a :class:`MessageLayout`.
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
