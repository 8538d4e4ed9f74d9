from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.clock import MonotonicClock, VirtualClock


def test_waiting_on_the_laboratory_clock_ends_at_or_after_the_deadline():
    clock = MonotonicClock()
    deadline_ns = clock.now_ns() + 2_000_000
    clock.sleep_until_ns(deadline_ns)
    assert clock.now_ns() >= deadline_ns
    clock.sleep_until_ns(0)


@settings(max_examples=50, derandomize=True)
@given(start=st.integers(-(10**12), 10**12), deadlines=st.lists(st.integers(-(10**12), 10**12), max_size=10))
def test_virtual_time_reaches_every_deadline_and_never_goes_back(start, deadlines):
    clock = VirtualClock(start)
    for deadline_ns in deadlines:
        before_ns = clock.now_ns()
        clock.sleep_until_ns(deadline_ns)
        assert clock.now_ns() == max(before_ns, deadline_ns)
