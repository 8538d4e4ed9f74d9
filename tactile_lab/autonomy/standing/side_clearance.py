"""Whether a hand with its palm upright comes to a standing box, and which fingertips would meet it there.

All that is known of the object is the box that was felt. The open hand, palm and forearm included, has to come along
its approach clear of box and table; then each finger closes, and its tip has to meet the box before a link of it does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from drivers.core.contacts import Array
from drivers.shadow.closing.closing import closing
from drivers.shadow.closing.collision_spheres import link_balls
from drivers.shadow.closing.hand_envelope import open_hand
from drivers.shadow.closing.posture import PROGRESS, HandShape
from sessions.motion.grasp_plan import GraspPlan

_APPROACH_m = (0.0, 0.02, 0.05, 0.09, 0.13)
"""Places of the approach that are looked at, before its end."""

_CLEAR_m, _CLEAR_CLOSING_m = 0.004, 0.002
_LEAST_FINGERS = 3


class Solid(Protocol):
    """Something on the table, as far as it is known."""

    def distances_m(self, places_m: Array) -> Array:
        """Of world places (..., 3) to its surface, negative inside, shape (...)."""


@dataclass(frozen=True)
class StandingBox:
    """An upright box on the table.

    Attributes:
        x_m, y_m, yaw_rad: of its middle, world.
        size_m: full sizes along its own axes and up.
    """

    x_m: float
    y_m: float
    yaw_rad: float
    size_m: tuple[float, float, float]

    @property
    def centre_m(self) -> Array:
        """Of its foot, world x, y."""
        return np.array([self.x_m, self.y_m])

    def front_m(self, way: Array) -> float:
        """Where it begins along the way one comes, a horizontal unit vector, shape (2,), from the world's origin."""
        return float(self.centre_m @ way) - self.half_along_m(way)

    def grow(self, side_m: float, top_m: float) -> StandingBox:
        """With every side farther out, and the top higher; less where that is negative."""
        x, y, z = self.size_m
        sizes = (max(x + 2 * side_m, 0.004), max(y + 2 * side_m, 0.004), max(z + top_m, 0.004))
        return replace(self, size_m=sizes)

    def half_along_m(self, direction: Array) -> float:
        """From its middle to where it ends along a horizontal unit vector, shape (2,), world."""
        c, s = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        return float(abs(direction @ [c, s]) * self.size_m[0] + abs(direction @ [-s, c]) * self.size_m[1]) / 2

    def foot_along_m(self, direction: Array) -> float:
        """From its middle to the edge over which it tips if pushed along a horizontal unit vector, shape (2,): that of
        the side which faces it, however askew.
        """
        c, s = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        is_along = abs(direction @ [c, s]) > abs(direction @ [-s, c])
        return self.size_m[0 if is_along else 1] / 2

    def way_out_m(self, start_m: Array, direction: Array) -> float:
        """From a place inside, world x, y, along a horizontal unit vector until its side; shapes (2,)."""
        c, s = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        own = np.array([[c, s], [-s, c]])
        place_m, way = own @ (start_m - [self.x_m, self.y_m]), own @ direction
        ways_m = [(np.sign(w) * size / 2 - at) / w for at, w, size in zip(place_m, way, self.size_m, strict=False) if w]
        return float(min(ways_m))

    def outside_m(self, places_m: Array) -> Array:
        """Of world places x, y (n, 2) from its outline, negative inside, shape (n,)."""
        return _signed(self._beyond_m(places_m))

    def outside_circle_m(self, places_m: Array) -> Array:
        """The same from the circle in it."""
        return np.asarray(np.linalg.norm(places_m - self.centre_m, axis=1) - np.mean(self.size_m[:2]) / 2)

    def distances_m(self, places_m: Array) -> Array:
        """Of world places (..., 3) to its surface, negative inside, shape (...)."""
        half_m = self.size_m[2] / 2
        upward_m = np.abs(places_m[..., 2] - half_m) - half_m
        return _signed(np.concatenate([self._beyond_m(places_m[..., :2]), upward_m[..., None]], axis=-1))

    def _beyond_m(self, places_m: Array) -> Array:
        """How far world places x, y (..., 2) lie beyond its sides along its own two axes, same shape."""
        c, s = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        x, y = np.moveaxis(places_m - self.centre_m, -1, 0)
        return np.asarray(np.abs(np.stack([c * x + s * y, -s * x + c * y], axis=-1)) - np.array(self.size_m[:2]) / 2)


@dataclass(frozen=True)
class ExpectedClosing:
    """What comes of closing the hand beside a standing object.

    Attributes:
        touches: where fingertips would meet it, world, shape (3,), by finger.
        stays_open: the fingers that must not close: a link of theirs would meet something before the fingertip does.
    """

    touches: Mapping[str, Array]
    stays_open: frozenset[str] = field(default_factory=frozenset)

    @property
    def holds(self) -> bool:
        """Whether the thumb is against fingers enough."""
        return "TH" in self.touches and len(self.touches) >= _LEAST_FINGERS


def is_way_clear(plan: GraspPlan, hand: HandShape, solid: Solid) -> bool:
    """Whether the open hand comes along its approach with nothing of it in the object or the table."""
    opened, table = open_hand(plan.closing, plan.height_m, hand), closing(plan.closing, plan.height_m, hand)
    if opened.lowest_m < _CLEAR_m:
        return False
    offsets_m = -np.array(_APPROACH_m)[:, None, None] * np.array(table.approach)
    return bool((solid.distances_m(_to_world(plan, opened.centres_m + offsets_m)) - opened.radii_m).min() >= _CLEAR_m)


def expected_closing(plan: GraspPlan, hand: HandShape, solid: Solid, surely: Solid) -> ExpectedClosing:
    """Which fingertips would meet an object, and which fingers have to stay open.

    Args:
        plan: of the grasp.
        hand: its form, and the shape of its fingertips.
        solid: the object; nothing but fingertips may meet it.
        surely: a fingertip counts only if it meets this smaller solid too.
    """
    table, links = closing(plan.closing, plan.height_m, hand), link_balls(plan.closing, plan.height_m, hand)
    tips_m = np.array([[table.path(finger).centre_m(u) for finger in table.fingers] for u in PROGRESS])
    tips_world_m = _to_world(plan, tips_m)
    meets = (solid.distances_m(tips_world_m) < hand.radius_m) & links.usable
    surely_meets = (surely.distances_m(tips_world_m) < hand.radius_m) & links.usable
    link_places_m = _to_world(plan, links.centres_m)
    in_something = solid.distances_m(link_places_m) < links.radii_m + _CLEAR_CLOSING_m
    in_something |= link_places_m[..., 2] < links.radii_m + _CLEAR_CLOSING_m
    touches, stays_open = {}, set()
    for index, finger in enumerate(table.fingers):
        stops = int(np.argmax(meets[:, index])) if meets[:, index].any() else len(PROGRESS) - 1
        passed = links.usable[: stops + 1, index]
        if in_something[: stops + 1][:, links.fingers == index][passed].any():
            stays_open.add(finger)
        elif surely_meets[:, index].any():
            way = plan.frame.pose.rotation().rotate(table.path(finger).direction)
            touches[finger] = tips_world_m[stops, index] + hand.radius_m * np.asarray(way)
    return ExpectedClosing(touches, frozenset(stays_open))


def _signed(beyond_m: Array) -> Array:
    """Distance to a box, negative inside, of places that lie so far beyond its faces along its axes, last axis."""
    return np.asarray(np.linalg.norm(np.maximum(beyond_m, 0.0), axis=-1) + np.minimum(beyond_m.max(axis=-1), 0.0))


def _to_world(plan: GraspPlan, places_m: Array) -> Array:
    """Places (..., 3) of the grasp frame in the world."""
    pose = plan.frame.pose.matrix()
    return np.asarray(places_m @ pose[:3, :3].T + pose[:3, 3])
