"""The status of an estimate: how much of it may be trusted, with the reasons in words.

``complete``: tracked, and nearly all of the shape was touched. ``partial``: a part of the shape is only a guess, or
many grasps could not be placed. ``ambiguous``: another placing of some grasps explains the contacts about as well, or
a sign says that a grasp is probably placed wrongly. ``lost``: the object could not be followed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from gtsam import Pose3

Status: TypeAlias = Literal["complete", "partial", "ambiguous", "lost"]

DoubtName: TypeAlias = Literal[
    "undone-slips",
    "unlikely-slip",
    "large-slips",
    "jump",
    "other-object",
    "loose-parts",
    "stray-contacts",
    "first-grasp",
    "refused-grasps",
    "few-grasps",
    "unknown-size",
    "missing-part",
    "unfelt-top",
    "fell",
    "rivals",
    "many-heights",
    "symmetry",
]

_PARTIAL: tuple[DoubtName, ...] = ("refused-grasps", "few-grasps", "unknown-size", "missing-part", "unfelt-top")
"""Doubts with which an estimate is not complete."""

LEAST_KNOWN_SHARE = 0.9
"""Of a complete shape. Contacts all around a hand-sized object reach 0.95 from six grasps on; where the inner corners
of a T-block were left out 0.75 to 0.85; one face reaches 0.3, two opposite faces or a corner 0.45 to 0.65.
"""

LARGEST_REFUSED_SHARE = 0.25
"""Of the grasps of a complete estimate."""

LEAST_GRASPS = 3
"""Placed ones of a complete estimate: contacts of fewer hardly confirm each other, wherever they are."""


@dataclass(frozen=True)
class Doubt:
    """One reason to doubt an estimate.

    Attributes:
        name: of the sign, the same in all files.
        words: what was seen, as a sentence without capital and full stop.
        grasps: numbers of the grasps concerned, from 0.
        grave: whether it makes the estimate ambiguous; others are only told.
    """

    name: DoubtName
    words: str
    grasps: tuple[int, ...] = ()
    grave: bool = True


@dataclass(frozen=True)
class Alternative:
    """Another placing of a grasp, or of successive ones, that the contacts allow.

    Attributes:
        grasps: their numbers, from 0.
        world_T_object: the object's poses at these grasps.
        probability: of this placing, if it or one of the others is right.
        turn_rad: largest rotation of a grasp relative to the estimate.
        shift_m: largest displacement of a contact relative to the estimate.
        rms_m: root mean square displacement of all contacts of the session.
    """

    grasps: tuple[int, ...]
    world_T_object: tuple[Pose3, ...]
    probability: float
    turn_rad: float
    shift_m: float
    rms_m: float

    def words(self) -> str:
        """The alternative as text."""
        first, last = self.grasps[0] + 1, self.grasps[-1] + 1
        which = f"grasp {first}" if first == last else f"grasps {first} to {last}"
        moved = f"turned by {np.degrees(self.turn_rad):.0f}° and moved by {1e3 * self.shift_m:.0f} mm"
        return f"{which} {moved} ({self.probability:.0%})"


def status_of(*, lost: bool, known_share: float | None, doubts: Sequence[Doubt]) -> Status:
    """The status, the worst that applies.

    Args:
        lost: whether the object could not be followed.
        known_share: share of the shape that was touched; None without a shape.
        doubts: all of them.
    """
    if lost:
        return "lost"
    if any(doubt.grave for doubt in doubts):
        return "ambiguous"
    whole = known_share is not None and known_share >= LEAST_KNOWN_SHARE
    return "complete" if whole and all(doubt.name not in _PARTIAL for doubt in doubts) else "partial"
