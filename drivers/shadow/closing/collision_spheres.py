"""The links above the fingertips as balls: where they are while the fingertips keep to the lines of a closing.

Fingertips are meant to touch and feel; the links above them feel nothing. Where one of those meets the object first,
the finger pushes it along until something holds it. A row of spheres along each link is enough to predict that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.shadow.closing.closing import MIRROR, Closing, closing, mirrored_closing
from drivers.shadow.closing.posture import NODES, PROGRESS, HandShape, finger_joints, moved_joints
from drivers.shadow.model.bodies import LINK_SHAPES, Ball, Capsule, Shape
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINT_TABLE, JOINTS, link_T_matrices

Verdicts: TypeAlias = NDArray[np.bool_]

_SPACING_m = 0.008


@dataclass(frozen=True)
class CollisionSpheres:
    """The links of the fingers at every tabulated posture of a closing.

    Attributes:
        centres_m: shape (NODES, n, 3), grasp frame.
        radii_m: shape (n,).
        fingers: which of the closing's fingers each belongs to, shape (n,).
        usable: postures that each finger can take up, shape (NODES, fingers).
    """

    centres_m: Array
    radii_m: Array
    fingers: NDArray[np.intp]
    usable: Verdicts

    def collides(self, distances_m: Array, free: Verdicts, postures: slice = slice(None)) -> Verdicts:
        """Whether a link of any finger is in something on its way, shape (...).

        Args:
            distances_m: of the balls' centres to it, negative inside, shape (..., k, n).
            free: whether each finger is still free to close, shape (..., k, fingers); it is open in any case.
            postures: the k ones of the closing.
        """
        usable = self.usable[postures]
        is_open = usable & (np.cumsum(usable, axis=0) == 1)
        passed = (usable & free) | is_open
        return np.asarray(((distances_m < self.radii_m) & passed[..., self.fingers]).any(axis=(-2, -1)))


@lru_cache(maxsize=64)
def link_balls(name: str, height_m: float, hand: HandShape) -> CollisionSpheres:
    """The links in the closing of that name and height; kept in memory.

    Raises:
        ConfigurationError: no such closing, or a height the hand cannot work at.
    """
    if hand.form.is_left:
        right = link_balls(mirrored_closing(name), height_m, hand.mirrored)
        return replace(right, centres_m=right.centres_m * MIRROR)
    return balls_of(closing(name, height_m, hand))


def balls_of(table: Closing) -> CollisionSpheres:
    """The links in a right hand's closing."""
    links = _grasp_T_links(table)
    centres, radii, fingers = [], [], []
    for index, finger in enumerate(table.fingers):
        for joint in finger_joints(finger):
            for shape in LINK_SHAPES.get(joint, ()):
                row_m, radius_m = _row_of_balls(shape)
                centres.append(links[joint][:, None, :3, :3] @ row_m[..., None] + links[joint][:, None, :3, 3:])
                radii += [radius_m] * len(row_m)
                fingers += [index] * len(row_m)
    lowest, highest = np.array([table.path(finger).valid for finger in table.fingers]).T
    usable = (PROGRESS[:, None] > lowest - 1e-9) & (PROGRESS[:, None] < highest + 1e-9)
    return CollisionSpheres(np.concatenate(centres, axis=1)[..., 0], np.array(radii), np.array(fingers), usable)


def _grasp_T_links(table: Closing) -> dict[str, Array]:
    """The frames of all links along a right hand's closing, by joint, shape (NODES, 4, 4) each."""
    joints_rad = np.zeros((NODES, len(JOINTS)))
    for finger in table.fingers:
        joints_rad[:, [JOINT_INDEX[joint] for joint in moved_joints(finger, table.form)]] = table.tables[finger]
    parent_T_link = link_T_matrices(joints_rad)
    found = {"palm": np.tile(table.grasp_T_palm.matrix(), (NODES, 1, 1))}
    for joint in reversed(JOINT_TABLE):  # parents come behind their children there
        if joint.parent in found:
            found[joint.name] = found[joint.parent] @ parent_T_link[:, JOINT_INDEX[joint.name]]
    return found


def _row_of_balls(shape: Shape) -> tuple[Array, float]:
    """Centres (n, 3) of the balls that stand for a link's capsule or ball, in the link's frame, and their radius."""
    if isinstance(shape, Ball):
        return np.array([shape.centre_m]), shape.radius_m
    assert isinstance(shape, Capsule), "fingers are made of these two"
    start_m, end_m = np.array(shape.start_m), np.array(shape.end_m)
    count = 1 + int(np.ceil(np.linalg.norm(end_m - start_m) / _SPACING_m))
    return np.linspace(start_m, end_m, count), shape.radius_m
