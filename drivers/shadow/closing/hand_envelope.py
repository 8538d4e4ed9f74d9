"""The whole open hand as balls, palm and forearm with it: what must keep clear of things while the hand travels.

Only fingertips feel. A palm, a knuckle or the forearm that meets an object pushes it with 10 to 200 N before any motor
tells; so geometry has to keep them off.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array
from drivers.core.poses import transform_points
from drivers.shadow.closing.closing import MIRROR, Closing, closing, mirrored_closing
from drivers.shadow.closing.collision_spheres import link_balls
from drivers.shadow.closing.posture import HandShape
from drivers.shadow.model.bodies import FOREARM, LINK_SHAPES, Ball, Block, Capsule, Shape
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINTS, forearm_T_palm, link_T_matrices

_SPACING_m = 0.012
_INSIDE_m = 0.012
"""A fingertip passes an object at least so far off where it is expected to."""
_STRAIGHT = np.zeros(len(JOINTS))


@dataclass(frozen=True)
class HandEnvelope:
    """Balls that cover the open hand.

    Attributes:
        centres_m: shape (n, 3), grasp frame.
        radii_m: shape (n,).
    """

    centres_m: Array
    radii_m: Array

    @property
    def lowest_m(self) -> float:
        """Height of the lowest point over the table."""
        return float((self.centres_m[:, 2] - self.radii_m).min())


@lru_cache(maxsize=128)
def open_hand(name: str, height_m: float, hand: HandShape) -> HandEnvelope:
    """The open hand in the closing of that name and height; kept in memory.

    Raises:
        ConfigurationError: no such closing, or a height the hand cannot work at.
    """
    if hand.form.is_left:
        right = open_hand(mirrored_closing(name), height_m, hand.mirrored)
        return replace(right, centres_m=right.centres_m * MIRROR)
    table, links = closing(name, height_m, hand), link_balls(name, height_m, hand)
    first = np.argmax(links.usable, axis=0)[links.fingers]
    tips_m = np.array([table.path(finger).centre_m(table.path(finger).valid[0]) for finger in table.fingers])
    palm_m, palm_radii_m = palm_and_forearm(table)
    return HandEnvelope(
        np.concatenate([palm_m, links.centres_m[first, np.arange(len(first))], tips_m]),
        np.concatenate([palm_radii_m, links.radii_m, np.full(len(tips_m), max(hand.semi_axes_m))]),
    )


@lru_cache(maxsize=128)
def lowest_inside_m(name: str, height_m: float, hand: HandShape) -> float:
    """Height over the table of the lowest link of the open hand that meets what its fingertip passes by: it reaches
    farther towards the other side of the grasp. Kept in memory.

    Raises:
        ConfigurationError: no such closing, or a height the hand cannot work at.
    """
    table, links = closing(name, height_m, hand), link_balls(name, height_m, hand)
    first = np.argmax(links.usable, axis=0)[links.fingers]
    centres_m = links.centres_m[first, np.arange(len(first))]
    paths = [table.path(finger) for finger in table.fingers]
    tips_m = np.array([path.centre_m(path.valid[0]) for path in paths])[links.fingers]
    ways = np.array([path.direction for path in paths])[links.fingers]
    inside_m = np.einsum("nk,nk->n", centres_m - tips_m, ways) + links.radii_m - hand.radius_m
    return float((centres_m[:, 2] - links.radii_m)[inside_m > _INSIDE_m].min(initial=np.inf))


def palm_and_forearm(table: Closing) -> tuple[Array, Array]:
    """Centres (n, 3) and radii (n,) of the balls of what does not move while the hand closes, grasp frame."""
    grasp_T_forearm = table.grasp_T_palm * forearm_T_palm(_STRAIGHT).inverse()
    forearm_T_wrist = Pose3(link_T_matrices(_STRAIGHT[None])[0, JOINT_INDEX["WRJ2"]])
    parts = [
        *((grasp_T_forearm, shape) for shape in FOREARM),
        *((grasp_T_forearm * forearm_T_wrist, shape) for shape in LINK_SHAPES["WRJ2"]),
        *((table.grasp_T_palm, shape) for shape in LINK_SHAPES["WRJ1"]),
    ]
    rows = [(frame, *_balls(shape)) for frame, shape in parts]
    centres_m = np.concatenate([transform_points(frame, places_m) for frame, places_m, _ in rows])
    return centres_m, np.concatenate([np.full(len(places_m), radius_m) for _, places_m, radius_m in rows])


def _balls(shape: Shape) -> tuple[Array, float]:
    """Centres (n, 3) of balls that stand for a shape, in its link's frame, and their radius."""
    if isinstance(shape, Ball):
        return np.array([shape.centre_m]), shape.radius_m
    if isinstance(shape, Capsule):
        start_m, end_m = np.array(shape.start_m), np.array(shape.end_m)
        count = 2 + int(np.linalg.norm(end_m - start_m) / _SPACING_m)
        return np.linspace(start_m, end_m, count), shape.radius_m
    half_m = np.array(shape.half_size_m if isinstance(shape, Block) else shape.semi_axes_m)
    radius_m = float(half_m.min())
    axes = [np.linspace(-h, h, 1 + int(np.ceil(2 * h / _SPACING_m))) for h in np.maximum(half_m - radius_m, 0.0)]
    return np.array(list(product(*axes))) + np.array(shape.centre_m), radius_m
