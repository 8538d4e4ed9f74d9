"""A plan of touches: which finger presses what, from where, with the hand turned how.

The hand points down with one finger stretched, the others bent away. So an error of a joint moves the tip sideways in
the hand, and turning the hand about the finger separates it from an error of the mount. A left hand turns the other way
round: each of its touches is the mirror image of a right hand's.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from gtsam import Pose3, Rot3

from calibration.steps.geometry import KnownGeometry, Patch, patches
from calibration.steps.observations import Plane
from drivers.core.contacts import FINGERS, Array
from drivers.positioner.kinematics import mount_joints
from drivers.shadow.closing.posture import LONG_FINGERS, TipEllipsoid
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm
from drivers.shadow.model.kinematics import forearm_T_palm_matrix, joint_vector, palm_T_distal_matrices

TURNS_rad = tuple(np.radians([-105.0, -35.0, 35.0, 105.0]))
"""Turns of the hand about the stretched finger."""

LEANS_rad = tuple(np.radians([12.0, 22.0]))
"""Lean of the finger against a face, or from the vertical on the top."""

Flexion: TypeAlias = tuple[float, float, float]

STRETCHED_rad: Flexion = (float(np.radians(8.0)), float(np.radians(8.0)), float(np.radians(4.0)))
"""Flexion of J3, J2 and J1 of a finger that points."""

_BENT_rad: Flexion = (float(np.radians(85.0)), float(np.radians(60.0)), float(np.radians(40.0)))
_THUMB_AWAY = {"THJ5": np.radians(-30.0), "THJ4": 0.1, "THJ3": 0.0, "THJ2": 0.0, "THJ1": 0.0}


@dataclass(frozen=True, eq=False)
class PlannedTouch:
    """One touch to make.

    Attributes:
        finger: which one presses.
        patch: what it presses.
        place_world_m: where, shape (3,).
        world_R_distal: orientation of the fingertip, shape (3, 3).
        flexion_rad: of the finger's J3, J2 and J1; stretched unless given.
        form: the hand that presses.
    """

    finger: str
    patch: Patch
    place_world_m: Array
    world_R_distal: Array
    flexion_rad: Flexion = STRETCHED_rad
    form: HandForm = RIGHT_HAND

    @property
    def joints_rad(self) -> Array:
        """The hand's joints for it, shape (24,)."""
        return pointing_vector(self.finger, self.flexion_rad, self.form)

    @property
    def instruction(self) -> str:
        """What to do, in words."""
        x, y, z = (1e3 * self.place_world_m).tolist()
        return f"{self.finger} presses {self.patch.target.name} at ({x:.0f}, {y:.0f}, {z:.0f}) mm"

    def world_T_distal(self, tip: TipEllipsoid, off_m: float = 0.0) -> Pose3:
        """The distal frame when the tip touches, or is ``off_m`` in front of the face."""
        outward, axes = self.patch.normal_world, np.array(tip.semi_axes_m)
        reach = float(np.linalg.norm(axes * (self.world_R_distal.T @ outward)))
        centre = self.place_world_m + (reach + off_m) * outward
        return Pose3(Rot3(self.world_R_distal), centre - self.world_R_distal @ np.array(tip.centre_distal_m))

    def base_q(self, world_T_mount: Pose3, joints_rad: Array, tip: TipEllipsoid, off_m: float = 0.0) -> Array:
        """Axes of the positioner for it, shape (6,), with the hand's joints at ``joints_rad``, shape (24,)."""
        side = self.form.side
        palm_T_distal = palm_T_distal_matrices(joints_rad, side)[FINGERS.index(self.finger)]
        forearm_T_distal = forearm_T_palm_matrix(joints_rad, side) @ palm_T_distal
        mount_T_forearm = world_T_mount.inverse() * self.world_T_distal(tip, off_m) * Pose3(forearm_T_distal).inverse()
        return np.asarray(mount_joints(mount_T_forearm, 0.0))


def pointing(finger: str, flexion_rad: Flexion = STRETCHED_rad, form: HandForm = RIGHT_HAND) -> dict[str, float]:
    """Joint angles with one long finger stretched (or flexed as given), the others and the thumb aside, radians.

    The others are bent away from a finger that points, and stretched above one that is bent. Joints that the hand does
    not have are not named.
    """
    angles = dict(_THUMB_AWAY)
    away = _BENT_rad if flexion_rad == STRETCHED_rad else (0.0, 0.0, 0.0)
    for other in LONG_FINGERS:
        shape = flexion_rad if other == finger else away
        angles |= {f"{other}{joint}": angle for joint, angle in zip(("J3", "J2", "J1"), shape, strict=True)}
    return {joint: angle for joint, angle in angles.items() if joint in form.joints}


def pointing_vector(finger: str, flexion_rad: Flexion = STRETCHED_rad, form: HandForm = RIGHT_HAND) -> Array:
    """:func:`pointing` as a joint vector, shape (24,)."""
    return joint_vector(pointing(finger, flexion_rad, form))


def plan_touches(
    geometry: KnownGeometry, fingers: Sequence[str] = ("FF", "MF"), per_patch: int = 8, form: HandForm = RIGHT_HAND
) -> tuple[PlannedTouch, ...]:
    """Touches of every patch, fingers and turns of the hand in turn, spread over the patch.

    Args:
        geometry: what can be pressed.
        fingers: long fingers to use.
        per_patch: touches of each.
        form: the hand that presses.
    """
    return tuple(
        touch
        for number, patch in enumerate(patches(geometry))
        for touch in _of_patch(patch, fingers, per_patch, number, form)
    )


def _of_patch(patch: Patch, fingers: Sequence[str], count: int, number: int, form: HandForm) -> Iterator[PlannedTouch]:
    for index in range(count):
        turn = form.handedness * TURNS_rad[(index + number) % len(TURNS_rad)]
        lean = LEANS_rad[(index // len(TURNS_rad)) % len(LEANS_rad)]
        place = patch.at(*_spread(index, count))
        rotation = orientation(patch, lean, turn, index)
        yield PlannedTouch(fingers[index % len(fingers)], patch, place, rotation, form=form)


def _spread(index: int, count: int) -> tuple[float, float]:
    """Places from -1 to 1: evenly along the first direction, by the golden section along the second."""
    first = -1.0 + 2.0 * (index + 0.5) / count
    return first, 2.0 * ((index * 0.618033988749895 + 0.3) % 1.0) - 1.0


def orientation(patch: Patch, lean: float, turn: float, index: int) -> Array:
    """The fingertip pointing down, leaning against the face, or to one side and another on a top."""
    normal = patch.normal_world
    if isinstance(patch.target, Plane) and abs(normal[2]) < 0.5:
        towards = -normal
    else:
        angle = 2.4 * index
        towards = np.array([np.cos(angle), np.sin(angle), 0.0])
    azimuth = float(np.arctan2(towards[1], towards[0]))
    mount_R_forearm = Rot3.Ypr(azimuth, np.pi / 2 - lean, turn).matrix()
    return np.asarray(mount_R_forearm @ np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
