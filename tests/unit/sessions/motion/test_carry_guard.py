"""When a carry ends before its end."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from sessions.motion.carry_guard import CarryGuard, cycles_evenly_along
from sessions.motion.cycle_settings import CycleSettings
from sessions.perception.carrying.slip import Slip

SETTINGS, ASKED = CycleSettings(), (20, 40, 60, 80)
LITTLE, FAR = Slip(0.001, 0.01), Slip(0.005, 0.01)


class Fingers:
    """Press as they are told, or too hard."""

    def __init__(self, pressed=(), holding=("FF", "TH")):
        self.told, self._pressed, self._holding = [], pressed, holding

    def servo_forces(self, targets_N, slack):
        self.told.append((targets_N, slack))

    def pressed(self, force_N):
        return self._holding if force_N < 0.5 else self._pressed_now()

    def _pressed_now(self):
        return next(self._pressed, ()) if isinstance(self._pressed, Iterator) else self._pressed


def carry(cycles, slips=None, pressed=(), holding=("FF", "TH")):
    """The guard after so many cycles, and after how many it ended the carry."""
    asked, fingers = iter(slips or []), Fingers(pressed, holding)
    guard = CarryGuard(fingers, {"FF": 0.8}, SETTINGS, ASKED, lambda: next(asked, None))
    ended = next((n for n in range(1, cycles + 1) if not guard.hold()), None)
    return guard, fingers, ended


def test_a_carry_without_slip_goes_on_with_the_slack_of_its_settings():
    guard, fingers, ended = carry(100, [LITTLE] * 5)
    assert ended is None
    assert guard.slipped is None
    assert fingers.told == [({"FF": 0.8}, SETTINGS.carry_slack)] * 100


@pytest.mark.parametrize("slip", [FAR, Slip(0.001, 0.1)])
def test_a_slip_ends_it_when_it_is_next_asked_for(slip):
    guard, _, ended = carry(100, [LITTLE, slip])
    assert ended == ASKED[1]
    assert guard.slipped == slip
    assert not guard.jammed


def test_fingertips_are_asked_where_the_hand_has_made_equal_parts_of_its_way():
    made = [(cycle - 1) / 100 for cycle in sorted(cycles_evenly_along(100, 5))]
    assert [made_share * made_share * (3 - 2 * made_share) for made_share in made] == pytest.approx(
        [0.2, 0.4, 0.6, 0.8], abs=0.02
    )


@pytest.mark.parametrize("parts", [0, 1])
def test_of_a_short_way_nothing_is_asked(parts):
    assert not cycles_evenly_along(20, parts)


def test_what_the_fingers_lose_ends_it_however_little_it_has_slipped():
    guard, _, ended = carry(100, [LITTLE], holding=("TH",))
    assert ended == 5
    assert guard.slipped == LITTLE


@pytest.mark.parametrize("holding", [("FF", "TH"), ("TH",)])
def test_fingertips_that_tell_no_slip_end_nothing(holding):
    assert carry(100, holding=holding)[2] is None


def test_a_fingertip_that_is_pressed_again_and_again_ends_it_as_well():
    """One that sticks and slips: the force grows, and between two peaks a cycle shows nothing."""
    told = iter([("TH",), ("TH",), (), ("TH",), ("TH",), ("TH",)])
    guard, _, ended = carry(100, pressed=told)
    assert ended == 5
    assert guard.jammed == ("TH",)


def test_jerks_far_apart_end_nothing():
    told = iter([each for _ in range(30) for each in (("TH",), ("TH",), (), ())])
    assert carry(100, pressed=told)[2] is None


def test_a_fingertip_that_stays_pressed_ends_it():
    guard, _, ended = carry(100, pressed=("TH",))
    assert ended == SETTINGS.pressed_cycles + 1
    assert guard.jammed == ("TH",)
