"""The hand with its first finger straight down and all else out of the way, to reach into what is open from above.

The palm is nearly level, the other long fingers are stretched out, and the thumb is held up: all of them stay some 85
mm above the fingertip. The finger leans a little, so that its tip meets a wall before its links do.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from gtsam import Pose3, Rot3
from numpy.typing import NDArray

from drivers.core.contacts import FINGERS, Array
from drivers.shadow.closing.closing import MIRROR, Closing, TipPath, mirrored
from drivers.shadow.closing.collision_spheres import balls_of
from drivers.shadow.closing.hand_envelope import palm_and_forearm
from drivers.shadow.closing.posture import NODES, HandShape, moved_joints, palm_rotations
from drivers.shadow.model.kinematics import joint_vector, palm_T_distal_matrices

FINGER = "FF"
"""It is at the side of the hand: no other finger is between it and the thumb."""

LEANS_rad = (float(np.deg2rad(13.0)), float(np.deg2rad(-13.0)))
"""Of the finger: its tip toward the grasp frame's +x axis, and toward -x, for which its knuckle turns by nearly 90
degrees.
"""

_TILT_rad = float(np.deg2rad(15.0))
"""Of the palm, nose down: with less of it the forearm hangs lower, with more the stretched fingers."""

_UPRIGHT_rad = np.pi / 2 - _TILT_rad
"""Angle of the knuckle at which the finger is upright."""

_OTHERS_rad = {"J3": float(np.deg2rad(-15.0)), "THJ2": -0.6, "THJ5": -1.0}
"""Stretched out and held up; joints that are not named stay at zero."""


@dataclass(frozen=True)
class FingerDown:
    """The posture. Its grasp frame has its origin in the lowest point of the fingertip.

    Attributes:
        table: as a closing on which no finger moves.
        ahead: the direction in which the fingertip leans, unit, shape (3,).
        tip_m: its centre, shape (3,).
        balls_m, radii_m: all else of the hand, shapes (n, 3), (n,).
        is_own: which of these are of the finger itself, shape (n,).
    """

    table: Closing
    ahead: Array
    tip_m: Array
    balls_m: Array
    radii_m: Array
    is_own: NDArray[np.bool_]

    def room_m(self, radius_m: float) -> float:
        """How far all else stays above the fingertip within a radius around it, seen from above: so deep the finger may
        go into something that reaches no farther.
        """
        beside_m = np.linalg.norm(self.balls_m[:, :2], axis=1) - self.radii_m
        lowest_m = (self.balls_m[:, 2] - self.radii_m)[~self.is_own & (beside_m < radius_m)]
        return float(lowest_m.min(initial=np.inf))


@lru_cache(maxsize=16)
def finger_down(lean_rad: float, hand: HandShape) -> FingerDown:
    """The posture with the finger leaning so far; kept in memory.

    Args:
        lean_rad: one of :data:`LEANS_rad`.
        hand: that takes it up.
    """
    if hand.form.is_left:
        right = finger_down(lean_rad, hand.mirrored)
        table = mirrored(right.table.name, right.table)
        return replace(right, table=table, tip_m=MIRROR * right.tip_m, balls_m=MIRROR * right.balls_m)
    angles_rad = _angles_rad(lean_rad, hand)
    palm = palm_rotations(np.array([[0.0, 0.0, 0.0, _TILT_rad, 0.0]]))[0]
    frames = palm @ palm_T_distal_matrices(joint_vector(angles_rad))[:, :3]
    centres_m = frames[:, :, :3] @ np.array(hand.centre_distal_m) + frames[:, :, 3]
    first = FINGERS.index(FINGER)
    lowest_m = centres_m[first] - [0.0, 0.0, np.linalg.norm(frames[first, 2, :3] * np.array(hand.semi_axes_m))]
    tips_m = {finger: centres_m[FINGERS.index(finger)] - lowest_m for finger in hand.form.fingers}
    table = _still(Pose3(Rot3(palm), -lowest_m), tips_m, angles_rad, hand)
    return FingerDown(table, np.array([np.sign(lean_rad), 0.0, 0.0]), tips_m[FINGER], *_all_else(table, tips_m))


def _still(
    grasp_T_palm: Pose3, tips_m: Mapping[str, Array], angles_rad: Mapping[str, float], hand: HandShape
) -> Closing:
    """A closing on which every finger stays where it is."""
    paths, tables = dict[str, TipPath](), dict[str, Array]()
    for finger, tip_m in tips_m.items():
        paths[finger] = TipPath(tip_m, tip_m, (0.0, 1.0))
        tables[finger] = np.tile([angles_rad[joint] for joint in moved_joints(finger, hand.form)], (NODES, 1))
    return Closing("finger-down", 0.0, hand.radius_m, grasp_T_palm, paths, tables, form=hand.form)


def _angles_rad(lean_rad: float, hand: HandShape) -> dict[str, float]:
    """Angles of the joints of all fingers."""
    joints = [joint for finger in hand.form.fingers for joint in moved_joints(finger, hand.form)]
    return {joint: _angle_rad(joint, lean_rad) for joint in joints}


def _angle_rad(joint: str, lean_rad: float) -> float:
    if joint.startswith(FINGER):
        return _UPRIGHT_rad - lean_rad if joint.endswith("J3") else 0.0
    return _OTHERS_rad.get(joint, 0.0 if joint.startswith("TH") else _OTHERS_rad.get(joint[2:], 0.0))


def _all_else(table: Closing, tips_m: Mapping[str, Array]) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Balls that stand for all but the first fingertip, their radii, and which are the first finger's links."""
    links, (palm_m, palm_radii_m) = balls_of(table), palm_and_forearm(table)
    others_m = np.array([tip_m for finger, tip_m in tips_m.items() if finger != FINGER])
    balls_m = np.concatenate([palm_m, others_m, links.centres_m[0]])
    radii_m = np.concatenate([palm_radii_m, np.full(len(others_m), table.radius_m), links.radii_m])
    is_own = np.zeros(len(radii_m), dtype=bool)
    is_own[-len(links.fingers) :] = links.fingers == table.fingers.index(FINGER)
    return balls_m, radii_m, is_own
