"""Slips that fingertips without forces hear."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import FINGERS
from sessions.perception.carrying.vibration import HeardSlip, SlipHearing

CYCLE_ns = 2_000_000


class Tip:
    """Hears noise of 10 counts, and ``loud`` counts more."""

    def __init__(self, seed: int) -> None:
        self.loud, self._rng = 0.0, np.random.default_rng(seed)
        self.is_silent = False

    def vibration_at(self, stamp_ns: int) -> tuple[int, ...]:
        swing = np.hypot(10.0, self.loud) * self._rng.standard_normal(2)
        return () if self.is_silent else (round(2042 + swing[0]), round(2042 + swing[1]))


class Held:
    """Five fingertips that hold an object: still for 0.2 s, then carrying it."""

    def __init__(self, seed: int = 0, still_cycles: int = 100) -> None:
        self.tips = {finger: Tip(10 * seed + at) for at, finger in enumerate(FINGERS)}
        self.hearing, self.now_ns = SlipHearing(self.tips), 0
        self.hearing.on_still()
        self.cycles(still_cycles)
        self.hearing.on_carry(self.now_ns)

    def cycles(self, count: int) -> None:
        for _ in range(count):
            self.now_ns += CYCLE_ns
            self.hearing.on_sample(self.now_ns)

    def slide(self, finger: str, loud: float, cycles: int) -> None:
        self.tips[finger].loud = loud
        self.cycles(cycles)
        self.tips[finger].loud = 0.0


def test_a_slip_is_heard_under_its_fingers_for_as_long_as_it_lasts() -> None:
    held = Held()
    held.cycles(100)
    assert held.hearing.slip is None
    held.slide("TH", 40.0, 100)
    held.slide("FF", 40.0, 100)
    held.cycles(100)
    slip = held.hearing.slip
    assert slip is not None
    assert slip.fingers == ("FF", "TH")
    assert slip.slipped_s == pytest.approx(0.4, abs=0.05)


def test_noise_alone_is_hardly_ever_a_slip() -> None:
    slips = 0
    for seed in range(20):
        held = Held(seed)
        held.cycles(1000)  # two seconds
        slips += held.hearing.slip is not None
    assert slips <= 1


def test_fingertips_that_vibrate_at_rest_have_a_level_of_their_own() -> None:
    held = Held(still_cycles=0)
    held.tips["MF"].loud = 60.0
    held.hearing.on_still()
    held.cycles(100)
    held.hearing.on_carry(held.now_ns)
    held.cycles(200)
    assert held.hearing.slip is None


def test_without_a_level_or_readings_nothing_is_heard() -> None:
    held = Held(still_cycles=3)
    held.slide("TH", 100.0, 200)
    assert held.hearing.slip is None
    held = Held()
    held.tips["TH"].is_silent = True
    held.slide("TH", 100.0, 200)
    assert held.hearing.slip is None


def test_what_is_left_is_listened_to_no_more_and_a_new_carry_begins_without_slip() -> None:
    held = Held()
    held.slide("TH", 100.0, 100)
    before = held.hearing.slip
    held.hearing.on_left()
    held.slide("FF", 100.0, 100)
    assert held.hearing.slip == before
    held.hearing.on_carry(held.now_ns)
    assert held.hearing.slip is None


@pytest.mark.parametrize(
    ("fingers", "words"),
    [
        (("TH",), "slips under TH, for 0.8 s"),
        (("FF", "TH"), "slips under FF and TH, for 0.8 s"),
        (("FF", "MF", "TH"), "slips under FF, MF and TH, for 0.8 s"),
    ],
)
def test_a_slip_in_words(fingers: tuple[str, ...], words: str) -> None:
    assert HeardSlip(fingers, 0.8).in_words() == words
