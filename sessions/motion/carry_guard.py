"""Holds an object while it is carried, and ends the carry where the object is jammed or slips."""

from __future__ import annotations

from collections.abc import Callable, Collection

from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_fingers import GraspFingers
from sessions.motion.grasp_plan import holds
from sessions.motion.motion import smooth
from sessions.perception.carrying.slip import Slip

_LEAST_HOLD_N, _LOST_CYCLES = 0.1, 5
"""A fingertip that presses less holds nothing, and an object that so many cycles in a row nothing holds is lost."""


def cycles_evenly_along(cycles: int, parts: int) -> frozenset[int]:
    """The cycles, counted from one, at whose beginning a motion has made another of so many equal parts of its way."""
    made = [int(parts * smooth(cycle / cycles)) for cycle in range(cycles)]
    return frozenset(cycle + 1 for cycle in range(1, cycles) if made[cycle] > made[cycle - 1])


class CarryGuard:
    """One cycle after the other of a carry.

    Args:
        fingers: that hold the object.
        targets_N: their forces.
        settings: limits.
        asked: cycles, counted from one, in which the fingertips are asked for the slip.
        slip: how far the object has slipped in this carry; None where the fingertips do not tell it.
    """

    def __init__(
        self,
        fingers: GraspFingers,
        targets_N: dict[str, float],
        settings: CycleSettings,
        asked: Collection[int],
        slip: Callable[[], Slip | None],
    ) -> None:
        self._fingers, self._targets_N, self._settings, self._slip = fingers, targets_N, settings, slip
        self._asked = asked
        self._cycles = self._pressed_cycles = self._lost_cycles = 0
        self.jammed: tuple[str, ...] = ()
        """The fingertips that were pressed so hard that the carry ended."""
        self.slipped: Slip | None = None
        """The slip that ended it: it was far, or the fingers lost the object."""

    def hold(self) -> bool:
        """Hold for a cycle. Returns whether the carry goes on."""
        s = self._settings
        self._fingers.servo_forces(self._targets_N, s.carry_slack)
        pressed = self._fingers.pressed(s.pressed_N)
        self._pressed_cycles = max(0, self._pressed_cycles + (1 if pressed else -1))
        if self._pressed_cycles > s.pressed_cycles:
            self.jammed = pressed
        self._cycles += 1
        self._lost_cycles = 0 if holds(frozenset(self._fingers.pressed(_LEAST_HOLD_N))) else self._lost_cycles + 1
        is_lost = self._lost_cycles == _LOST_CYCLES
        if is_lost or self._cycles in self._asked:
            found = self._slip()
            if found is not None and (is_lost or found.far_m > s.carry_slip_m or found.turned_rad > s.carry_slip_rad):
                self.slipped = found
        return not self.jammed and self.slipped is None
