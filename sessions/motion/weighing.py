"""Weighing: drags the held object to and fro, lifts it by a few millimetres, and sets it down again.

The table's friction pulls the other way when the hand turns round: half the difference is the friction, without what
the fingers do to each other. The lifted object is moved to and fro as well. What hangs free does not mind; what still
stands on the table with an edge is held back, and its weight is not all in the fingers: then the hand holds it as
firmly as it may, and lifts it higher. While it hangs it is squeezed more and less: its weight stays, and what changes
in the sum of the forces tells by how much the joint angles are wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.shadow.closing.closing import Closing
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import holds
from sessions.motion.lift import FIRMER, Lift, LiftEnd
from sessions.motion.motion import Motion
from sessions.perception.weighing.weighing import Hanging

_BACK_m, _JERK, _TRIES = 0.003, 2, 2
_STANDS_SHARE = 0.5
"""Of the upward force: less, and the object that is set down stands on the table."""
_PRESSED_SHARE = 0.95
"""Of the force that counts as pressed hard: what a fingertip may press with for a moment."""


class WeighingSettings(StrictModel):
    """How gently the object is lifted.

    Attributes:
        squeeze_N: force of each finger while the object hangs; the thumb holds against their sum.
        squeeze_s: time to build it up.
        firm_share: what does not hang free is held so firmly that the fingertip that presses most does so with this
            share of ``cycle.pressed_N``, for the next lift.
        lifts_m, lift_m_s: how far, one after the other until it hangs free, and how fast.
        lower_m_s: how fast it is set down; what leans lands on an edge, and is turned between the fingers.
        landed_N: force of each finger once it stands, until the hand is down.
        most_N: upward force at which the hand lifts no further, and sets the object down again.
        drag_m: how far to each side the object is dragged.
        shift_m, shift_m_s: how far to each side it is moved while it hangs; how fast it is moved and dragged.
        most_share, least_share: the hanging object is squeezed with so much of ``squeeze_N``, and with so much of that.
        swings, swing_s: how often, and how long each time.
        rest_s: for the object to stop swinging.
        patience: cycles in a row with too much force, or without a hold, after which the object is set down again.
    """

    retired: ClassVar[Mapping[str, str]] = {"lift_m": "lifts_m has how far it is lifted, one lift after the other"}

    squeeze_N: float = Field(default=0.8, gt=0.0)
    squeeze_s: float = Field(default=0.5, gt=0.0)
    firm_share: float = Field(default=0.9, gt=0.0, le=1.0)
    lifts_m: tuple[Annotated[float, Field(gt=0.0, le=0.05)], ...] = Field(default=(0.015, 0.025), min_length=1)
    lift_m_s: float = Field(default=0.04, gt=0.0, le=0.05)
    lower_m_s: float = Field(default=0.010, gt=0.0, le=0.05)
    landed_N: float = Field(default=0.3, gt=0.0)
    most_N: float = Field(default=8.0, gt=0.0)
    drag_m: float = Field(default=0.006, gt=0.0, le=0.02)
    shift_m: float = Field(default=0.003, gt=0.0, le=0.01)
    shift_m_s: float = Field(default=0.03, gt=0.0, le=0.05)
    most_share: float = Field(default=1.25, ge=1.0)
    least_share: float = Field(default=0.8, gt=0.0, le=1.0)
    swings: int = Field(default=3, ge=0)
    swing_s: float = Field(default=0.8, gt=0.0)
    rest_s: float = Field(default=0.1, ge=0.0)
    patience: int = Field(default=5, ge=1)


@dataclass(frozen=True)
class Grip:
    """Force control of the fingers that hold the object.

    Attributes:
        hold: one cycle of it, to this force of each finger, N, by all of them or only by those that feel the object.
        share_pressed: the force of each finger with which the fingertip that presses most does so with this share of
            the force that counts as pressed hard.
        holding: the fingertips that press the object.
        is_pressed: whether one is pressed hard.
    """

    hold: Callable[[float, bool], None]
    share_pressed: Callable[[float], float]
    holding: Callable[[], frozenset[str]]
    is_pressed: Callable[[], bool]


class _Lowered:
    """Fingertips of an object that is set down: which of them have lost it.

    Args:
        held_by: the fingertips that held it before it was lifted.
        holding: those that feel something now.
        patience: cycles in a row without a touch before a fingertip has lost the object.
    """

    def __init__(self, held_by: frozenset[str], holding: Callable[[], frozenset[str]], patience: int) -> None:
        self._holding, self._patience, self._lost = holding, patience, held_by - holding()
        self._untouched = dict.fromkeys(held_by, 0)

    def on_cycle(self) -> None:
        """Count the cycles in which each feels nothing."""
        holding = self._holding()
        self._untouched = {tip: 0 if tip in holding else count + 1 for tip, count in self._untouched.items()}
        self._lost |= {tip for tip, count in self._untouched.items() if count > self._patience}

    def is_above(self) -> bool:
        """Whether one that lost it feels something again."""
        return bool(self._lost & self._holding())


class Weigher:
    """Drags, lifts and sets down.

    Args:
        motion: supervised motion.
        settings: limits.
        grip: of the object.
    """

    def __init__(self, motion: Motion, settings: WeighingSettings, grip: Grip) -> None:
        self._motion, self._settings, self._grip = motion, settings, grip
        self._squeeze_N = settings.squeeze_N
        self._is_up, self._carried_N = False, 0.0
        self._lowered: _Lowered | None = None
        """The fingertips, while the object is set down."""

    def weigh(self, frame: GraspFrame, table: Closing) -> Lift:
        """Drag and lift the object held at a grasp frame, and set it down where it was.

        An object that slipped out is not there any more: the hand stays where it lost it.
        """
        s, runtime = self._settings, self._motion.runtime

        def raised(height_m: float, aside_m: float = 0.0) -> Array:
            return self._motion.base_joints(frame.shifted_inside(np.array([0.0, aside_m])), table, height_m)

        self._rest(s.squeeze_s)
        runtime.begin_hold()
        runtime.begin_dragging()
        end = self._move_to_and_fro(raised, 0.0, s.drag_m)
        if end is LiftEnd.HUNG:
            runtime.end_dragging()
            end = self._lift(raised)
        return Lift(end, self._carried_N, self._squeeze_N, self._grip.share_pressed(s.firm_share))

    def _lift(self, raised: Callable[..., Array]) -> LiftEnd:
        """Up and down again; once more, firmer and higher, if it did not hang free and the fingers may press more."""
        s, end, self._carried_N, held_by = self._settings, LiftEnd.HELD, 0.0, self._grip.holding()
        for height_m in s.lifts_m:
            share, end = self._follow(lambda share: raised(share * height_m), height_m / s.lift_m_s)  # noqa: B023
            if end is LiftEnd.HUNG:
                end = self._hang(raised, height_m)
                self._is_up = False
            lowered = _Lowered(held_by, self._grip.holding, s.patience)
            if end is not LiftEnd.LOST and not self._set_down(raised, share * height_m, lowered, end is LiftEnd.HUNG):
                end = LiftEnd.ABOVE
            firm_N = self._grip.share_pressed(s.firm_share)
            if end is not LiftEnd.HELD or firm_N < FIRMER * s.squeeze_N:
                break
            self._squeeze_N = firm_N
            self._rest(s.squeeze_s)
        return end

    def _hang(self, raised: Callable[..., Array], height_m: float) -> LiftEnd:
        """To and fro, and what hangs free is squeezed more and less; :attr:`LiftEnd.HELD` if something but the
        fingertips holds the object. Fingers that carry nothing up there have lost it, whatever they touch.
        """
        runtime, self._is_up = self._motion.runtime, True
        self._rest(self._settings.rest_s)
        runtime.begin_hanging()
        if (end := self._move_to_and_fro(raised, height_m, self._settings.shift_m)) is not LiftEnd.HUNG:
            return end
        found = runtime.end_hanging()
        if isinstance(found, Hanging) and not found.is_free:
            return LiftEnd.HELD
        runtime.begin_hanging()
        end = self._swing_squeeze(raised(height_m))
        runtime.end_hanging()
        return end

    def _swing_squeeze(self, joints: Array) -> LiftEnd:
        """Squeeze more and less, the positioner's joints at rest."""
        s, usual_N = self._settings, self._squeeze_N
        most_N = min(s.most_share * usual_N, self._grip.share_pressed(_PRESSED_SHARE))
        least_N = s.least_share * most_N

        def squeezed(share: float) -> Array:
            self._squeeze_N = float(np.interp(np.sin(2 * np.pi * s.swings * share), [-1.0, 1.0], [least_N, most_N]))
            return joints

        _, end = self._follow(squeezed, s.swings * s.swing_s)
        self._squeeze_N = usual_N
        return end

    def _set_down(self, raised: Callable[..., Array], height_m: float, lowered: _Lowered, hung: bool) -> bool:
        """Down again. Where a fingertip is pressed, the hand goes a little back: an edge has come to stand, and the
        fingers slide on loosely; or one has slid up and comes down on the object: then it is pressed again.

        A fingertip that has lost the object, before or meanwhile, closes no further, and counts as pressed as soon as
        it feels something: it is above the object.

        An object that hung free has crept down in the fingers, and stands before the hand is down: then they slide
        along it. One on an edge is held until the hand is down: its weight is not all in the fingers anyway, and let go
        of early it falls out of them.

        Returns:
            Whether the hand is down.
        """
        s, self._squeeze_N = self._settings, self._settings.squeeze_N
        held_N = self._motion.runtime.perception.held_N
        stands_N = _STANDS_SHARE * held_N() if hung else -np.inf

        def slide() -> None:
            if held_N() < stands_N:
                self._squeeze_N = s.landed_N

        self._lowered, left_m = lowered, height_m
        for _ in range(_TRIES):
            if not (left_m := self._lower(raised, left_m, slide)):
                self._lowered, self._squeeze_N = None, s.squeeze_N
                self._rest(s.rest_s)
                return True
            self._squeeze_N = s.landed_N
            left_m = self._go_back(raised, left_m)
        return False

    def _go_back(self, raised: Callable[..., Array], height_m: float) -> float:
        """A little up. Returns the height there."""
        duration_s = _BACK_m / self._settings.lift_m_s
        self._motion.follow(lambda share: raised(height_m + share * _BACK_m), duration_s, self._keep)
        return height_m + _BACK_m

    def _lower(self, raised: Callable[..., Array], height_m: float, each: Callable[[], None]) -> float:
        """Down from a height, ``each`` cycle, until a fingertip is pressed. Returns how high that was; 0 if never."""

        def lowered(share: float) -> Array:
            each()
            return raised((1 - share) * height_m)

        share, end = self._follow(lowered, height_m / self._settings.lower_m_s, LiftEnd.PRESSED, _JERK)
        return (1 - share) * height_m if end is LiftEnd.PRESSED else 0.0

    def _move_to_and_fro(self, raised: Callable[..., Array], height_m: float, far_m: float) -> LiftEnd:
        """To one side, to the other and back, across the direction in which the thumb holds against the fingers: along
        it, their forces would change.

        Args:
            raised: positioner joints at a height and a distance aside.
            height_m: the height.
            far_m: how far to each side.
        """
        duration_s = 4 * far_m / self._settings.shift_m_s
        return self._follow(lambda share: raised(height_m, _to_and_fro(share) * far_m), duration_s)[1]

    def _follow(
        self,
        pose_at: Callable[[float], Array],
        duration_s: float,
        only: LiftEnd | None = None,
        patience: int | None = None,
    ) -> tuple[float, LiftEnd]:
        """Follow a path until its end, or until there is an objection: only ``only``, and for more than ``patience``
        cycles, where they are given.
        """
        most, ended, in_a_row = self._settings.patience if patience is None else patience, LiftEnd.HUNG, 0

        def go_on() -> bool:
            nonlocal ended, in_a_row
            self._keep()
            objection = self._objection()
            objection = objection if only in (None, objection) else None
            in_a_row = 0 if objection is None else in_a_row + 1
            if in_a_row > most:
                ended = objection or ended
            return ended is LiftEnd.HUNG

        share = self._motion.follow(pose_at, duration_s, go_on)
        return share, ended

    def _objection(self) -> LiftEnd | None:
        if self._grip.is_pressed() or (self._lowered and self._lowered.is_above()):
            return LiftEnd.PRESSED
        held_N = self._motion.runtime.perception.held_N()
        self._carried_N = max(self._carried_N, held_N)
        if not holds(self._grip.holding()) or (self._is_up and held_N < 0.0):
            return LiftEnd.LOST
        return LiftEnd.HEAVY if held_N > self._settings.most_N else None

    def _keep(self) -> bool:
        if self._lowered:
            self._lowered.on_cycle()
        self._grip.hold(self._squeeze_N, self._lowered is not None)
        return True

    def _rest(self, duration_s: float) -> None:
        for _ in range(self._motion.cycles(duration_s)):
            self._keep()
            self._motion.tick()


def _to_and_fro(share: float) -> float:
    """From 0 to 1, to -1 and back to 0."""
    return float(np.interp(share, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0]))
