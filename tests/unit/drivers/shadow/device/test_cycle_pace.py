"""When the hand's cycles start after one was late."""

from __future__ import annotations

from drivers.core.clock import VirtualClock
from drivers.shadow.device.cycle_pace import CyclePace

US = 1_000


def starts(clock: VirtualClock, pace: CyclePace, count: int) -> list[int]:
    """When the next cycles start, microseconds."""
    found = []
    for _ in range(count):
        pace.wait()
        found.append(clock.now_ns() // US)
    return found


def test_cycles_start_on_a_grid_whatever_they_take() -> None:
    clock = VirtualClock()
    pace = CyclePace(clock, 1000 * US)
    for number, took_us in enumerate((0, 300, 900, 10), start=1):
        assert pace.wait() == (0, 0)
        assert clock.now_ns() == 1000 * number * US
        clock.sleep_until_ns(clock.now_ns() + took_us * US)


def test_after_a_late_cycle_the_next_close_up_without_crowding_the_palm() -> None:
    clock = VirtualClock()
    pace = CyclePace(clock, 1000 * US)
    clock.sleep_until_ns(1400 * US)
    assert pace.wait() == (400 * US, 0)
    assert starts(clock, pace, 4) == [2300, 3200, 4100, 5000]


def test_only_whole_periods_are_left_out() -> None:
    clock = VirtualClock()
    pace = CyclePace(clock, 1000 * US)
    clock.sleep_until_ns(4100 * US)
    assert pace.wait() == (3100 * US, 3)
    assert starts(clock, pace, 2) == [5000, 6000]
