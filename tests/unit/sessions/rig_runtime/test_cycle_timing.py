"""A session that was late itself says so: what it read too late looks like a device that is silent."""

from __future__ import annotations

import pytest

from drivers.core.clock import VirtualClock
from sessions.rig_runtime.cycle_timing import CycleTiming

CYCLE_ns = 10_000_000


def run(timing: CycleTiming, clock: VirtualClock, *, between_s: float = 0.0, devices_s: float = 0.0) -> None:
    """One cycle, with the time that was spent before it and in it."""
    clock.sleep_until_ns(clock.now_ns() + round(between_s * 1e9))
    timing.begin()
    clock.sleep_until_ns(clock.now_ns() + round(devices_s * 1e9))
    timing.wait()


@pytest.fixture
def clock() -> VirtualClock:
    return VirtualClock()


@pytest.fixture
def timing(clock: VirtualClock) -> CycleTiming:
    timing = CycleTiming(clock, CYCLE_ns)
    run(timing, clock)
    return timing


def test_a_session_that_keeps_its_cycle_was_not_late(timing: CycleTiming, clock: VirtualClock) -> None:
    for _ in range(100):
        run(timing, clock, between_s=0.005, devices_s=0.02)
    assert timing.lateness() == ""


def test_what_it_did_meanwhile_is_told(timing: CycleTiming, clock: VirtualClock) -> None:
    run(timing, clock, between_s=2.5, devices_s=0.1)
    assert "late: 2.6 s busy with other work, its cycle is 10 ms" in timing.lateness()
    run(timing, clock, between_s=0.1, devices_s=3.1)
    assert "late: 3.2 s taking in what the devices sent" in timing.lateness()


def test_a_cycle_that_is_not_over_counts(timing: CycleTiming, clock: VirtualClock) -> None:
    timing.begin()
    clock.sleep_until_ns(clock.now_ns() + 700_000_000)
    assert "late: 0.7 s" in timing.lateness()


def test_what_was_long_ago_explains_nothing(timing: CycleTiming, clock: VirtualClock) -> None:
    run(timing, clock, between_s=2.5)
    for _ in range(600):
        run(timing, clock)
    assert timing.lateness() == ""
