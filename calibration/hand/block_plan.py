"""A plan of touches of one rigid block with several fingers, stretched and bent, for the joints' offsets.

A stretched finger only determines the sum of its joints: J3, J2 and J1 turn its tip about nearly the same point. Bent
once at the knuckle and once beyond it, each joint has its own lever; the block relates the fingers to each other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from calibration.forearm.touch_plan import Flexion, PlannedTouch, STRETCHED_rad, TURNS_rad, orientation
from calibration.steps.geometry import Block, KnownGeometry, Patch, load_geometry, patches
from drivers.core.contacts import FINGERS as HAND
from drivers.core.errors import ConfigurationError
from drivers.shadow.closing.posture import TipEllipsoid
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm
from drivers.shadow.model.kinematics import forearm_T_palm_matrix, palm_T_distal_matrices

FINGERS = ("FF", "MF", "RF")

FLEXIONS_rad: tuple[Flexion, ...] = (
    STRETCHED_rad,
    (0.1, float(np.radians(45.0)), float(np.radians(27.0))),
    (0.1, float(np.radians(55.0)), float(np.radians(33.0))),
)
"""Stretched, and bent beyond the knuckle, where a finger's last two joints share their travel about so."""

CLEAR_m = 0.085
"""Least height of palm and forearm above the table."""

_LEANS_rad = tuple(np.radians([6.0, 12.0, 18.0]))


def load_block(path: Path) -> Block:
    """The block of a geometry file. Raises ConfigurationError."""
    block = load_geometry(path).block
    if block is None:
        hint = "Give its size and pose: block: {size_m: [...], world_T_block: {...}}"
        raise ConfigurationError("does not describe a block", where=str(path), hint=hint)
    return block


def plan_block(
    block: Block, fingers: Sequence[str] = FINGERS, rounds: int = 1, form: HandForm = RIGHT_HAND
) -> tuple[PlannedTouch, ...]:
    """Every finger, in every flexion, on every face of the block that can be pressed.

    Args:
        block: at a known place.
        fingers: long fingers.
        rounds: how often all of that, elsewhere on the faces and with the hand turned otherwise.
        form: the hand that presses.
    """
    return tuple(
        touch for number, finger in enumerate(fingers) for touch in _of_finger(block, finger, number, rounds, form)
    )


def _of_finger(block: Block, finger: str, number: int, rounds: int, form: HandForm) -> Iterator[PlannedTouch]:
    faces = _faces(block)
    for index in range(rounds * len(FLEXIONS_rad) * len(faces)):
        group = index // len(faces)
        patch, flexion = faces[index % len(faces)], FLEXIONS_rad[group % len(FLEXIONS_rad)]
        first, second = np.sin([2.4 * index + number, 1.7 * index + 2 * number])
        place = patch.at(first, second if patch.normal_world[2] > 0.5 else _high(second))
        ways = (
            PlannedTouch(finger, patch, place, orientation(patch, lean, form.handedness * turn, index), flexion, form)
            for lean in np.roll(_LEANS_rad, index)
            for turn in np.roll(TURNS_rad, index + group + number)
        )
        if (clear := next((way for way in ways if _height_m(way) >= CLEAR_m), None)) is not None:
            yield clear


def _high(share: float) -> float:
    """A place in the upper part of a side, from -1 to 1: lower down a bent finger's neighbours meet the top."""
    return 0.6 + 0.35 * share


def _faces(block: Block) -> list[Patch]:
    """The faces in pressing order, the top after each side: only heights determine a bent finger's joints."""
    found = [patch for patch in patches(KnownGeometry(block=block)) if patch.target.name.startswith("block")]
    tops = [patch for patch in found if patch.normal_world[2] > 0.5]
    return [face for side in found if side not in tops for face in (side, *tops)]


def _height_m(touch: PlannedTouch) -> float:
    """Height of the lower one of palm and forearm above the world's z = 0."""
    joints, side = touch.joints_rad, touch.form.side
    world_T_distal = touch.world_T_distal(TipEllipsoid()).matrix()
    world_T_palm = world_T_distal @ np.linalg.inv(palm_T_distal_matrices(joints, side)[HAND.index(touch.finger)])
    world_T_forearm = world_T_palm @ np.linalg.inv(forearm_T_palm_matrix(joints, side))
    return float(min(world_T_palm[2, 3], world_T_forearm[2, 3]))
