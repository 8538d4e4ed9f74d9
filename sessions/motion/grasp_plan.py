"""Grasp plans, and how they change if the hand lands on the object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, TypeAlias

import numpy as np
from pydantic import Field

from drivers.shadow.closing.closing import Closing, HIGHEST_m, LOWEST_m
from sessions.motion.grasp_frame import GraspFrame

ContactHeight: TypeAlias = Annotated[float, Field(ge=LOWEST_m, le=HIGHEST_m)]
"""A setting: height of the fingertips' centres above the table, metres."""


@dataclass(frozen=True)
class TouchPlace:
    """Where a side is touched.

    Attributes:
        frame: the grasp frame, in the world, on the side.
        height_m: of the lowest fingertip.
        up_to_m: fingertips up to this height are all laid against it, above it only the one that meets it: several push
            an object over that one leaves standing.
    """

    frame: GraspFrame
    height_m: float
    up_to_m: float = 0.0


@dataclass(frozen=True)
class Opening:
    """What is open from above, so that one finger can go in.

    Attributes:
        half_m: how far its walls are expected from its middle.
        rim_m: height of its rim.
        deepest_m: how low a fingertip may go.
    """

    half_m: float
    rim_m: float
    deepest_m: float


@dataclass(frozen=True)
class GraspPlan:
    """One grasp to execute.

    Attributes:
        frame: the grasp frame in the world.
        closing: one of :data:`drivers.shadow.closing.closing.CLOSINGS`.
        height_m: height of the fingertip centres above the table.
        reason: why this grasp was chosen, for people.
        tap: touch first: tap on the top, or from the side touch the side that the hand comes from.
        only_touch: only touch, and do not close: tap on the top, or touch the side that a closing from there comes to.
        places: where it touches that side, one after another.
        down_to_m: one finger alone touches the top, no lower than this, in the frame's origin.
        opening: one finger goes down into it, in the frame's origin, and touches floor and walls.
        may_shift: where a fingertip lands the hand may try again a little aside.
        may_rise: where only a link lands it may try again higher.
        is_gentle: fingertips press less than usual: what they hold leans easily.
        stays_open: fingers that do not close.
    """

    frame: GraspFrame
    closing: str
    height_m: float
    reason: str = ""
    tap: bool = False
    only_touch: bool = False
    places: tuple[TouchPlace, ...] = ()
    down_to_m: float | None = None
    opening: Opening | None = None
    may_shift: bool = True
    may_rise: bool = True
    is_gentle: bool = False
    stays_open: frozenset[str] = frozenset()

    def raised(self, by_m: float, highest_m: float) -> GraspPlan | None:
        """The same grasp so much higher, in whole millimetres; None above ``highest_m``, or where it may not be."""
        height_m = float(np.ceil(1e3 * (self.height_m + by_m)) / 1e3)
        return replace(self, height_m=height_m) if self.may_rise and height_m <= min(highest_m, HIGHEST_m) else None

    def as_plain(self, index: int) -> dict[str, Any]:
        """The plan of grasp number ``index``, from 0, as plain data for viewers; metres and radians on the table."""
        return {
            "index": index,
            "closing": self.closing,
            "x_m": self.frame.x_m,
            "y_m": self.frame.y_m,
            "yaw_rad": self.frame.yaw_rad,
            "height_m": self.height_m,
            "reason": self.reason,
        }


def evade(
    wanted: GraspPlan,
    now: GraspPlan,
    hit: Sequence[str],
    landed: set[str],
    table: Closing,
    shift_m: float,
    yaw_window_rad: tuple[float, float],
) -> GraspPlan:
    """The plan after a landing: shifted toward the fingers that landed, or turned when both sides did.

    Args:
        wanted, now: the plan as chosen, and its current form.
        hit: fingers that landed just now.
        landed: those that landed since the hand was turned, including ``hit``; cleared when it turns.
        table: the plan's closing.
        shift_m: distance to shift.
        yaw_window_rad: yaws the arm can reach.
    """
    if "TH" in landed and landed - {"TH"}:
        landed.clear()
        return replace(wanted, frame=_turn_away(wanted.frame, yaw_window_rad))
    directions = np.array([table.path(finger).start_m[:2] for finger in hit])
    aside_m = shift_m * np.mean(directions / np.linalg.norm(directions, axis=1)[:, None], 0)
    return replace(now, frame=now.frame.shifted_inside(aside_m))


def _turn_away(frame: GraspFrame, yaw_window_rad: tuple[float, float]) -> GraspFrame:
    """A quarter turn, as far as the arm's yaw window allows, toward its middle."""
    low, high = yaw_window_rad
    turn = -np.pi / 2 if frame.yaw_rad > (low + high) / 2 else np.pi / 2
    return replace(frame, yaw_rad=float(np.clip(frame.yaw_rad + turn, low, high)))


def holds(touching: frozenset[str]) -> bool:
    """Whether these fingers can carry the object: the thumb against another, or both side fingers."""
    return ("TH" in touching and len(touching) > 1) or {"FF", "LF"} <= touching
