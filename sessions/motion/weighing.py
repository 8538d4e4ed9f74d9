"""Weighing: drags the held object to and fro, lifts it by a few millimetres, and sets it down again.

The table's friction pulls the other way when the hand turns round: half the difference is the friction, without what
the fingers do to each other. The lifted object is moved to and fro as well. What hangs free does not mind; what still
stands on the table with an edge is held back, and its weight is not all in the fingers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.shadow.closing.closing import Closing
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import holds
from sessions.motion.motion import Motion


class WeighingSettings(StrictModel):
    """How gently the object is lifted.

    Attributes:
        squeeze_N: force of each finger while the object hangs; the thumb holds against their sum.
        squeeze_s: time to build it up.
        lift_m, lift_m_s: how far and how fast.
        most_N: upward force at which the hand lifts no further, and sets the object down again.
        drag_m: how far to each side the object is dragged.
        shift_m, shift_m_s: how far to each side it is moved while it hangs; how fast it is moved and dragged.
        rest_s: for the object to stop swinging.
        patience: cycles in a row with too much force, or without a hold, after which the object is set down again.
    """

    squeeze_N: float = Field(default=0.8, gt=0.0)
    squeeze_s: float = Field(default=0.5, gt=0.0)
    lift_m: float = Field(default=0.015, gt=0.0, le=0.05)
    lift_m_s: float = Field(default=0.04, gt=0.0, le=0.05)
    most_N: float = Field(default=8.0, gt=0.0)
    drag_m: float = Field(default=0.006, gt=0.0, le=0.02)
    shift_m: float = Field(default=0.003, gt=0.0, le=0.01)
    shift_m_s: float = Field(default=0.03, gt=0.0, le=0.05)
    rest_s: float = Field(default=0.1, ge=0.0)
    patience: int = Field(default=5, ge=1)


class LiftEnd(StrEnum):
    """How a lift ended, in words."""

    HUNG = "it was lifted and set down again"
    HEAVY = "it is too heavy: the upward force reached its limit"
    LOST = "it slipped out of the fingers"
    PRESSED = "a fingertip was pressed hard"


@dataclass(frozen=True)
class Grip:
    """Force control of the fingers that hold the object.

    Attributes:
        hold: one cycle of it, to this force of each finger, N.
        holding: the fingertips that press the object.
        is_pressed: whether one is pressed hard.
    """

    hold: Callable[[float], None]
    holding: Callable[[], frozenset[str]]
    is_pressed: Callable[[], bool]


class Weigher:
    """Drags, lifts and sets down.

    Args:
        motion: supervised motion.
        settings: limits.
        grip: of the object.
    """

    def __init__(self, motion: Motion, settings: WeighingSettings, grip: Grip) -> None:
        self._motion, self._settings, self._grip = motion, settings, grip

    def weigh(self, frame: GraspFrame, table: Closing) -> LiftEnd:
        """Drag and lift the object held at a grasp frame, and set it down where it was."""
        s, runtime = self._settings, self._motion.runtime

        def raised(height_m: float, aside_m: float = 0.0) -> Array:
            return self._motion.base_joints(frame.shifted_inside(np.array([0.0, aside_m])), table, height_m)

        self._rest(s.squeeze_s)
        runtime.begin_hold()
        end = self._move_to_and_fro(raised, (0.0, s.drag_m), runtime.begin_dragging, runtime.end_dragging)
        if end is LiftEnd.HUNG:
            end = self._lift(raised)
        self._rest(s.rest_s)
        return end

    def _lift(self, raised: Callable[..., Array]) -> LiftEnd:
        """Up, to and fro, and down again, as far as the object lets it."""
        s, runtime = self._settings, self._motion.runtime
        share, end = self._follow(lambda share: raised(share * s.lift_m), s.lift_m / s.lift_m_s)
        if end is LiftEnd.HUNG:
            self._rest(s.rest_s)
            end = self._move_to_and_fro(raised, (s.lift_m, s.shift_m), runtime.begin_hanging, runtime.end_hanging)
        height_m = share * s.lift_m
        self._motion.follow(lambda share: raised((1 - share) * height_m), s.lift_m / s.lift_m_s, self._keep)
        return end

    def _move_to_and_fro(
        self,
        raised: Callable[..., Array],
        where_m: tuple[float, float],
        begin: Callable[[], object],
        complete: Callable[[], object],
    ) -> LiftEnd:
        """To one side, to the other and back; what the fingertips feel meanwhile is measured.

        The hand moves across the direction in which the thumb holds against the fingers: along it, their forces would
        change.

        Args:
            raised: positioner joints at a height and a distance aside.
            where_m: the height, and how far to each side.
            begin, complete: start and end the measurement in the runtime.
        """
        height_m, far_m = where_m
        begin()
        duration_s = 4 * far_m / self._settings.shift_m_s
        _, end = self._follow(lambda share: raised(height_m, _to_and_fro(share) * far_m), duration_s)
        if end is LiftEnd.HUNG:
            complete()
        return end

    def _follow(self, pose_at: Callable[[float], Array], duration_s: float) -> tuple[float, LiftEnd]:
        """Follow a path until its end, or until the object must be set down again."""
        ended, in_a_row = LiftEnd.HUNG, 0

        def go_on() -> bool:
            nonlocal ended, in_a_row
            self._keep()
            objection = self._objection()
            in_a_row = 0 if objection is None else in_a_row + 1
            if objection is not None and in_a_row > self._settings.patience:
                ended = objection
            return ended is LiftEnd.HUNG

        share = self._motion.follow(pose_at, duration_s, go_on)
        return share, ended

    def _objection(self) -> LiftEnd | None:
        if self._grip.is_pressed():
            return LiftEnd.PRESSED
        if not holds(self._grip.holding()):
            return LiftEnd.LOST
        return LiftEnd.HEAVY if self._motion.runtime.perception.held_N() > self._settings.most_N else None

    def _keep(self) -> bool:
        self._grip.hold(self._settings.squeeze_N)
        return True

    def _rest(self, duration_s: float) -> None:
        for _ in range(self._motion.cycles(duration_s)):
            self._keep()
            self._motion.tick()


def _to_and_fro(share: float) -> float:
    """From 0 to 1, to -1 and back to 0."""
    return float(np.interp(share, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0]))
