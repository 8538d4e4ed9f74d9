"""When a carry ends before its end."""

from __future__ import annotations

import pytest

from sessions.motion.carry_guard import CarryGuard
from sessions.motion.cycle_settings import CycleSettings
from sessions.perception.carrying.slip import Slip

SETTINGS, CYCLE_s = CycleSettings(), 0.01
LITTLE, FAR = Slip(0.001, 0.01), Slip(0.005, 0.01)


class Fingers:
    """Press as they are told, or too hard."""

    def __init__(self, pressed=(), holding=("FF", "TH")):
        self.told, self._pressed, self._holding = [], pressed, holding

    def servo_forces(self, targets_N, slack):
        self.told.append((targets_N, slack))

    def pressed(self, force_N):
        return self._holding if force_N < 0.1 else self._pressed


def carry(cycles, slips=None, pressed=(), holding=("FF", "TH")):
    """The guard after so many cycles, and after how many it ended the carry."""
    asked, fingers = iter(slips or []), Fingers(pressed, holding)
    guard = CarryGuard(fingers, {"FF": 0.8}, SETTINGS, CYCLE_s, lambda: next(asked, None))
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
    assert ended == 2 * round(SETTINGS.slip_check_s / CYCLE_s)
    assert guard.slipped == slip
    assert not guard.jammed


def test_what_a_single_fingertip_touches_is_not_held_and_slips_no_more():
    assert carry(100, [FAR] * 5, holding=("TH",))[2] is None


def test_fingertips_that_tell_no_slip_end_nothing():
    assert carry(100)[2] is None


def test_a_fingertip_that_stays_pressed_ends_it():
    guard, _, ended = carry(100, pressed=("TH",))
    assert ended == SETTINGS.pressed_cycles + 1
    assert guard.jammed == ("TH",)
