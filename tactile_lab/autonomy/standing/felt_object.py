"""What was felt of an object that stays where it stands: a box around all contacts, and what is new beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from gtsam import Pose2
from numpy.typing import NDArray

from drivers.core.contacts import ApproachPath, Array, Grasp
from sessions.conductor.object_gone import OPENING_m
from sessions.motion.probing.bounding_box import BoundingBox
from sessions.motion.probing.box_fit import fit_box, on_sides
from tactile_lab.autonomy.standing.openings import Openings, nowhere, to_nearest_m
from tactile_lab.autonomy.standing.roundness import is_round
from tactile_lab.autonomy.standing.side_clearance import StandingBox
from tactile_lab.autonomy.standing.storeys import Storeys, storeys_of

_LEAST_FOR_BOX = 4
"""Contacts that tell a box, and whether it is one."""

_ASIDE_rad = (0.0, np.radians(30.0), np.radians(-30.0))
"""Yaws beside those across the sides of the box: what is round has no sides. A hand that closes on the corner of a box
pushes it away, and makes it lean."""

_FAR_m, _NEAR_m = 0.04, 0.010
"""What is touched farther than the first from all contacts is as new as can be; nearer than the second it is known."""

_RIM_m = 0.040
"""What is no lower below the top narrows an opening."""

_SLENDER = 0.2
"""Of its height the foot reaches from the middle. A box on a bulged bottom creeps over by a degree in every touch."""

_UNSTEADY = 0.15
"""So much more slender, it leans in a grasp: thumb and fingers press at different heights."""

_UPWARD, _NO_SIDE = 0.7, 0.3
"""Least vertical part of the normal of a contact on the top, and the largest of one on a side; an edge is both."""

_SURELY_m = 0.015
"""Contacts are few: an object is wider than the box around them."""

_SAME_PLACE_m = 0.010
"""Two taps on one place meet it no farther apart."""
_ASSUMED_m = 0.030
"""From the middle to a side of which nothing is known."""


@dataclass
class FeltObject:
    """One object on the table.

    Attributes:
        box: around it, as felt.
        grasps: that were added.
        openings: where it is open from above.
    """

    box: BoundingBox
    grasps: int = 0
    _points_m: Array = field(default_factory=nowhere)
    _normals: Array = field(default_factory=nowhere)
    """Of all contacts, as their places: shape (n, 3), world frame."""

    _looked_m: dict[bool, Array] = field(default_factory=lambda: {True: nowhere(), False: nowhere()})
    """Places on the top, and on sides."""

    openings: Openings = field(default_factory=Openings)
    _passed_m: list[Array] = field(default_factory=list)
    _pushed: Array | None = None
    _first: BoundingBox = field(init=False)
    _moved: BoundingBox = field(init=False)
    """The first one, where it is by now."""

    def __post_init__(self) -> None:
        self._first = self._moved = self.box

    @classmethod
    def around(cls, centre_m: Array, top_m: float, points_m: Array, normals: Array) -> FeltObject:
        """An object of which contacts are known, perhaps none.

        Args:
            centre_m: where it is expected, world x, y.
            top_m: its height.
            points_m, normals: of contacts, shape (n, 3), world frame.
        """
        reach_m = np.full(2, _ASSUMED_m)
        box = BoundingBox(Pose2(float(centre_m[0]), float(centre_m[1]), 0.0), -reach_m, reach_m, 0.0, top_m, {})
        felt = cls(box)
        felt.add(points_m, normals)
        return felt

    # --- what has happened -------------------------------------------------------------------------------------

    def on_grasp(self, grasp: Grasp) -> None:
        """Take note of its contacts."""
        self.grasps += 1
        self.add(grasp.points_world_m, grasp.normals_world)

    def add(self, points_m: Array, normals: Array) -> None:
        """Contacts, shape (n, 3) each, world frame; the box is fitted again."""
        self._points_m, self._normals = np.vstack([self._points_m, points_m]), np.vstack([self._normals, normals])
        if not len(self._points_m):
            return
        points_m, normals = self._points_m, self._normals
        top_m = max(self.box.top_m or 0.0, float(points_m[:, 2].max()))
        beside = self._is_outside(points_m, normals)
        if np.count_nonzero(beside) >= _LEAST_FOR_BOX:
            self.box = self._fitted(points_m[beside], normals[beside])
        places = np.array([self.box.world_T_box.transformTo(point) for point in points_m[:, :2]])
        low_m, high_m = np.minimum(self.box.low_m, places.min(0)), np.maximum(self.box.high_m, places.max(0))
        self.box = replace(self.box, low_m=low_m, high_m=high_m, top_m=top_m)

    def on_landings(self, places_m: Sequence[Array]) -> None:
        """Fingertips landed on it at these places, (3,) each, world: it reaches at least as far."""
        inside_m = np.array([self.box.world_T_box.transformTo(place[:2]) for place in places_m]).reshape(-1, 2)
        low_m, high_m = (
            bound([ends, *inside_m], axis=0) for bound, ends in ((np.min, self.box.low_m), (np.max, self.box.high_m))
        )
        self.box = self._first = self._moved = replace(self.box, low_m=low_m, high_m=high_m)

    def _is_outside(self, points_m: Array, normals: Array) -> NDArray[np.bool_]:
        """Which contacts are on sides, and not on the inside of something hollow, shape (n,)."""
        outward = points_m[:, :2] - self._moved.centre_world_m
        return np.asarray(on_sides(normals) & (np.einsum("nk,nk->n", outward, normals[:, :2]) > 0))

    def _fitted(self, points_m: Array, normals: Array) -> BoundingBox:
        """The box around contacts on sides; where none faces outward it reaches as far as the first box did."""
        pose, low_m, high_m = fit_box(points_m, normals)
        angles = np.arctan2(normals[:, 1], normals[:, 0]) - pose.theta()
        faces = set((np.round(angles / (np.pi / 2)).astype(int) % 4).tolist())
        first_m = np.array([pose.transformTo(corner) for corner in _side_middles(self._moved)])
        for face in {0, 1, 2, 3} - faces:
            axis, bound, outer = face % 2, low_m if face >= 2 else high_m, np.min if face >= 2 else np.max
            bound[axis] = outer([bound[axis], outer(first_m[:, axis])])
        return replace(self.box, world_T_box=pose, low_m=low_m, high_m=high_m)

    def place(self, points_m: Array, normals: Array, motion: Pose2) -> None:
        """All contacts as they are placed by now, after a motion of the object since its first pose.

        Args:
            points_m, normals: shape (n, 3) each, world frame.
            motion: world frame.
        """
        self._points_m, self._normals, self._moved = nowhere(), nowhere(), self._first.move(motion)
        self.add(points_m, normals)

    def on_looked(self, places_m: Array, *, on_top: bool = False) -> None:
        """Contacts were expected at these places of the top or of sides, (n, 3), world: found there, elsewhere or
        nowhere, they are no longer new.
        """
        self._looked_m[on_top] = np.vstack([self._looked_m[on_top], places_m])

    def look_again(self) -> None:
        """Places on top and sides where contacts were expected and found elsewhere, or nowhere, are new again."""
        self._looked_m = {True: nowhere(), False: nowhere()}

    def on_pushed(self, way: Array) -> None:
        """It was touched from one side alone along a horizontal unit vector, world, shape (2,)."""
        if self.is_slender(way):
            self._pushed = way

    def on_missed_top(self, places_m: Array) -> None:
        """Fingertips of a tap were expected at these places, (n, 3), world: those far from all contacts met nothing."""
        self.openings.on_missed(places_m, to_nearest_m(places_m, self._points_m))

    def on_passed(self, paths: Sequence[ApproachPath]) -> None:
        """Fingertips that came to touch a side have gone these ways."""
        self._passed_m += [path.end_world_m for path in paths if not path.touched]

    # --- what is known -----------------------------------------------------------------------------------------

    @property
    def middle_m(self) -> Array:
        """Of the box, world x, y."""
        return self.box.centre_world_m

    @property
    def standing_box(self) -> StandingBox:
        """The box as a solid."""
        (x, y), (length_m, width_m) = self.middle_m.tolist(), (self.box.high_m - self.box.low_m).tolist()
        return StandingBox(x, y, self.box.world_T_box.theta(), (length_m, width_m, self.box.top_m or 0.0))

    @property
    def storeys(self) -> Storeys:
        """The box, narrower at heights where contacts say so."""
        points_m, normals = self._points_m, self._normals
        return storeys_of(self.box, points_m, normals, self._is_outside(points_m, normals))

    @property
    def is_round(self) -> bool:
        """Whether contacts say that the box is no box; see :func:`is_round`."""
        points_m, normals = self._points_m, self._normals
        beside, yaw_rad = on_sides(normals), self.box.world_T_box.theta()
        if np.count_nonzero(beside) < _LEAST_FOR_BOX:
            return False
        return is_round(points_m[beside, :2], normals[beside, :2], self.middle_m, yaw_rad)

    @property
    def is_wide(self) -> bool:
        """Whether the hand does not open as wide in any direction, as far as is known."""
        return min(self.standing_box.size_m[:2]) > OPENING_m - _SURELY_m

    def yaws(self, window_rad: tuple[float, float], askew_rad: float = 0.0) -> list[float]:
        """Of hands that come across its sides, as far as the arm turns; so far from square where it turns less."""
        low, high = window_rad
        theta, asides = self.box.world_T_box.theta(), _ASIDE_rad if self.is_round else (0.0,)
        yaws = [theta + quarter * np.pi / 2 + aside for quarter in range(-3, 4) for aside in asides]
        return [float(np.clip(yaw, low, high)) for yaw in yaws if low - askew_rad <= yaw <= high + askew_rad]

    def distances_m(self, places_m: Array, *, on_top: bool = False) -> Array:
        """Of places (n, 3) of the top or of sides to the nearest where a contact was that faces so, or was expected
        before, shape (n,), at most 40 mm. What lies below an edge is not known from above it.
        """
        points_m, normals = self._points_m, self._normals
        facing = normals[:, 2] > _NO_SIDE if on_top else normals[:, 2] < _UPWARD
        return np.minimum(to_nearest_m(places_m, np.vstack([points_m[facing], self._looked_m[on_top]])), _FAR_m)

    def was_touched(self, place_m: Array) -> bool:
        """Whether a contact was at a place, shape (3,), world, or as near as two taps on one place are."""
        return bool(to_nearest_m(place_m[None], self._points_m)[0] < _SAME_PLACE_m)

    def are_open(self, places_m: Array) -> NDArray[np.bool_]:
        """Whether a tap has met nothing near places of the top, (n, 3), and nearer than any contact is, shape (n,)."""
        return self.openings.are_open(places_m, to_nearest_m(places_m, self._points_m))

    def opening(self) -> tuple[Array, float] | None:
        """The middle of what is open from above, world x, y, and how far from it the nearest contact is, if any."""
        high = self._points_m[:, 2] > (self.box.top_m or 0.0) - _RIM_m
        return self.openings.widest(self._points_m[high, :2])

    def inside_distances_m(self, places_m: Array, normals: Array) -> Array:
        """Of places inside an opening, with outward normals, shape (n, 3) each, to the nearest where a contact was that
        faces alike, or was expected before, shape (n,), at most 40 mm.
        """
        return np.minimum(self.openings.apart_m(places_m, normals, self._points_m, self._normals), _FAR_m)

    def passed_m(self, place_m: Array, way: Array) -> float:
        """How far beyond a place of a side, shape (3,), fingertips went along a horizontal unit vector, shape (2,), at
        its height, and met nothing; 0 where none did.
        """
        beyond_m = np.array(self._passed_m).reshape(-1, 3) - place_m
        along_m = beyond_m[:, :2] @ way
        aside_m = np.linalg.norm(beyond_m - along_m[:, None] * [*way, 0.0], axis=1)
        return float(along_m[aside_m < _NEAR_m].max(initial=0.0))

    def is_slender(self, way: Array) -> bool:
        """Whether it is so tall against its foot along a horizontal unit vector, shape (2,), that little leans it."""
        return self.standing_box.foot_along_m(way) < _SLENDER * self.standing_box.size_m[2]

    def is_unsteady(self, way: Array) -> bool:
        """Whether even a grasp that closes along a horizontal unit vector, shape (2,), leans it."""
        return self.standing_box.foot_along_m(way) < _UNSTEADY * self.standing_box.size_m[2]

    def may_be_pushed(self, way: Array) -> bool:
        """Whether a touch along ``way`` leans it no farther than the last one has; see :meth:`on_pushed`."""
        return not self.is_slender(way) or self._pushed is None or float(way @ self._pushed) < 0

    def novelty_m(self, places_m: Array, *, on_top: bool = False) -> float:
        """How new contacts at places (n, 3) would be: the sum of their distances to what is known."""
        return float(self.distances_m(places_m, on_top=on_top).sum())

    def are_new(self, places_m: Array, *, on_top: bool = False) -> NDArray[np.bool_]:
        """Which of the places (n, 3) are not known yet, shape (n,)."""
        return self.is_new(self.distances_m(places_m, on_top=on_top))

    @staticmethod
    def is_new(known_m: Array) -> NDArray[np.bool_]:
        """Which places so far from what is known, any shape, are not known yet."""
        return known_m > _NEAR_m

    def is_unknown(self, places_m: Array) -> bool:
        """Whether places (n, 3) are on average far from all that is known."""
        return bool(self.distances_m(places_m).mean() > 2 * _NEAR_m)

    @property
    def is_top_felt(self) -> bool:
        """Whether a contact is on its top."""
        return bool(self._on_top.any())

    @property
    def top_place_m(self) -> Array:
        """Where its top was met, world x, y; the middle of the box where it was not."""
        on_top = self._on_top
        return np.asarray(self._points_m[on_top, :2].mean(axis=0)) if on_top.any() else self.middle_m

    @property
    def _on_top(self) -> NDArray[np.bool_]:
        """Which contacts face up close to its top, shape (n,)."""
        return (self._normals[:, 2] > _UPWARD) & (self._points_m[:, 2] > (self.box.top_m or 0.0) - _NEAR_m)

    def in_words(self) -> str:
        """Its size, for people."""
        size_m = self.standing_box.size_m
        width, length = sorted(1e3 * np.array(size_m[:2]))
        return f"the object is {width:.0f} x {length:.0f} mm wide and {1e3 * size_m[2]:.0f} mm high"


def _side_middles(box: BoundingBox) -> Array:
    """The middles of its four sides, world x, y, shape (4, 2)."""
    middle_m = (box.low_m + box.high_m) / 2
    places = [(box.low_m[0], middle_m[1]), (box.high_m[0], middle_m[1])]
    places += [(middle_m[0], box.low_m[1]), (middle_m[0], box.high_m[1])]
    return np.array([box.world_T_box.transformFrom(np.array(place)) for place in places])
