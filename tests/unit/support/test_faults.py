"""Faults that a wrapper injects into any transport."""

from __future__ import annotations

import pytest

from drivers.core.errors import DeviceError
from drivers.core.transports import Datagram, ReplayTransport
from tests.support.faults import (
    SLAVE_TO_SAFEOP,
    WORKING_COUNTER_LOW,
    ClockJump,
    CounterWrap,
    Delay,
    Drop,
    Duplicate,
    FarEnd,
    Fault,
    FaultyTransport,
    Field,
    FlipBit,
    MessageLayout,
    Reorder,
    Saturate,
    StaleSequence,
    StuckValue,
    Truncate,
    Unplug,
    When,
    standard_faults,
)

LAYOUT = MessageLayout(counters=(Field(0, 1),), values=(1, 2), saturate=lambda payload: payload[:1] + b"\xff")


def numbered(count: int = 6) -> list[Datagram]:
    return [Datagram(bytes((number, 10 + number)), 100 * number) for number in range(count)]


def through(fault: Fault, when: When | None = None, messages: list[Datagram] | None = None) -> list[Datagram]:
    sent = messages or numbered()
    transport = FaultyTransport(ReplayTransport("wire", sent), fault, when or When(first=2))
    return [datagram for _ in sent for datagram in transport.receive()]


def counters(datagrams: list[Datagram]) -> list[int]:
    return [datagram.payload[0] for datagram in datagrams]


def test_messages_are_dropped_doubled_and_swapped() -> None:
    assert counters(through(Drop())) == [0, 1, 3, 4, 5]
    assert counters(through(Duplicate())) == [0, 1, 2, 2, 3, 4, 5]
    swapped = through(Reorder())
    assert counters(swapped) == [0, 1, 3, 2, 4, 5]
    assert [datagram.stamp_ns for datagram in swapped] == [0, 100, 300, 300, 400, 500]


def test_delayed_messages_arrive_together_and_late() -> None:
    late = through(Delay(readings=3))
    assert counters(late) == [0, 1, 2, 3, 4, 5]
    assert [datagram.stamp_ns for datagram in late] == [0, 100, 500, 500, 500, 500]


def test_bytes_are_cut_off_and_bits_flipped() -> None:
    assert through(Truncate())[2].payload == b"\x02"
    assert through(FlipBit(0))[2].payload == bytes((3, 12))
    assert through(FlipBit(-1))[2].payload == bytes((2, 12 | 0x80))


def test_counters_stand_still_or_wrap() -> None:
    assert counters(through(StaleSequence(LAYOUT))) == [0, 1, 1, 3, 4, 5]
    assert counters(through(CounterWrap(LAYOUT, at=2))) == [254, 255, 0, 1, 2, 3]


def test_values_saturate_or_stick() -> None:
    assert [datagram.payload[1] for datagram in through(Saturate(LAYOUT))] == [10, 11, 255, 13, 14, 15]
    stuck = through(StuckValue(LAYOUT), When(first=2, count=0))
    assert [datagram.payload for datagram in stuck[3:]] == [bytes((number, 12)) for number in (3, 4, 5)]


def test_an_unplugged_wire_stays_dead_until_it_is_opened_again() -> None:
    transport = FaultyTransport(ReplayTransport("wire", numbered()), Unplug(), When(first=1))
    assert len(transport.receive()) == 1
    for action in (transport.receive, transport.receive, lambda: transport.send(b"x")):
        with pytest.raises(DeviceError, match=r"wire: the wire is unplugged\. Plug it in"):
            action()
    transport.open()
    assert counters(transport.receive()) == [2]


def test_the_clock_jumps_once_and_stays_off() -> None:
    assert [datagram.stamp_ns for datagram in through(ClockJump(-50))] == [0, 100, 150, 250, 350, 450]


def test_the_far_end_is_told_and_wrappers_can_be_nested() -> None:
    class Ring(ReplayTransport):
        told: list[str]

        def inject(self, fault: str) -> None:
            self.told = [*getattr(self, "told", []), fault]

    ring = Ring("hand", numbered())
    inner = FaultyTransport(ring, FarEnd(WORKING_COUNTER_LOW, ring), When(first=1))
    outer = FaultyTransport(inner, FarEnd(SLAVE_TO_SAFEOP, inner), When(first=2))
    for _ in range(4):
        outer.receive()
    assert ring.told == [WORKING_COUNTER_LOW, SLAVE_TO_SAFEOP]
    assert (inner.injected, outer.injected) == (1, 1)
    with pytest.raises(ValueError, match="has no fault"):
        FaultyTransport(ReplayTransport("wire", []), Drop()).inject(WORKING_COUNTER_LOW)


def test_a_schedule_strikes_every_so_often_or_at_random_but_repeatably() -> None:
    assert counters(through(Drop(), When(first=1, every=2, count=2))) == [0, 2, 4, 5]
    many = numbered(200)
    once, again = (through(Drop(), When(first=0, count=0, share=0.3), many) for _ in range(2))
    assert once == again
    assert 120 < len(once) < 160


def test_an_unarmed_fault_does_nothing_and_counts_nothing() -> None:
    transport = FaultyTransport(ReplayTransport("wire", numbered()), Drop(), When(first=0, count=0))
    transport.armed = False
    assert len(transport.receive()) == 1
    transport.armed = True
    assert transport.receive() == []
    assert (transport.received, transport.injected) == (1, 1)


def test_the_standard_faults_follow_what_the_messages_have() -> None:
    everything, plain = standard_faults(LAYOUT), standard_faults(MessageLayout())
    assert set(everything) - set(plain) == {"stale sequence", "counter wrap", "saturate", "stuck value"}
    with pytest.raises(ValueError, match="saturated"):
        Saturate(MessageLayout())
