"""A second family of simulated grasps: other shapes, other closings, other noise, and no code shared with the first.

An estimator that was tuned on one generator may state uncertainties that hold for that generator only. Here fingers
come from evenly spread directions towards points inside the object; the errors of contacts have heavy tails, are partly
common to a grasp (an error of the palm's pose) and partly to a session (the sensors' bias, drawn once); slips have
heavy tails.
Their standard deviations are those that contacts and settings state: 1 mm (of which the palm has a part), 5 degrees,
10 mm and 20 degrees.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from gtsam import Pose3, Rot3
from numpy.typing import NDArray

from drivers.core.contacts import FINGERS, ApproachPath, Array, Contact, Grasp
from drivers.core.errors import ConfigurationError

POINT_SIGMA_m, NORMAL_SIGMA_rad = 0.001, float(np.deg2rad(5.0))
SLIP_SIGMA_m, SLIP_SIGMA_rad = 0.010, float(np.deg2rad(20.0))

_COMMON_SHARE = 0.3
"""Share of the variance of a contact's position that all contacts of a grasp have in common."""

OWN_SIGMA_m, PALM_SIGMA_m = POINT_SIGMA_m * np.sqrt([1.0 - _COMMON_SHARE, _COMMON_SHARE])
"""What contacts state, and what is stated of the palm: that all contacts of a grasp have in common."""

_BIAS_SIGMA_m = 0.0002
"""Standard deviation of how much deeper or higher than the surface all contacts of a session lie."""

_BIAS_COVARIANCE_m2 = _BIAS_SIGMA_m**2 * np.eye(3)
"""What contacts state of it: what all touches of all fingers share, as after a calibration that is good to so much."""

_CONTACT_FREEDOM, _SLIP_FREEDOM = 4.0, 6.0
"""Degrees of freedom of Student's t distribution, scaled to the stated standard deviation."""

_START_m, _BEYOND_m = 0.130, 0.130
_WRONG_m = 0.015
_FORCE_N = 0.7
_PARALLEL = 1e-12


@dataclass(frozen=True)
class Body:
    """A true solid standing on the table.

    Attributes:
        triangles_m: corners of the faces, counter-clockwise from outside, shape (m, 3, 3).
        outline_m: its section at half its height, counter-clockwise, shape (n, 2).
        height_m: of the top.
    """

    triangles_m: Array
    outline_m: Array
    height_m: float


@dataclass(frozen=True)
class SecondGrasps:
    """A session of the second family.

    Attributes:
        shape: name of the body.
        grasps: the data that the program may use.
        world_T_body: true pose at each grasp.
        body: the true solid.
    """

    shape: str
    grasps: tuple[Grasp, ...]
    world_T_body: tuple[Pose3, ...]
    body: Body


def _ring(radius_m: float, sides: int, *, half: bool = False) -> Array:
    angles = np.linspace(-np.pi / 2, np.pi / 2, sides) if half else 2 * np.pi * np.arange(sides) / sides
    return radius_m * np.column_stack([np.cos(angles), np.sin(angles)])


_T_m = 1e-3 * np.array([[-14, -45], [14, -45], [14, 15], [45, 15], [45, 45], [-45, 45], [-45, 15], [-14, 15]])
_OUTLINES_m: Mapping[str, Array] = {
    "wedge": 1e-3 * np.array([[-55.0, -25.0], [50.0, -25.0], [-55.0, 32.0]]),
    "t-block": _T_m,
    "octagonal-prism": _ring(0.042, 8),
    "tapered-cup": _ring(0.038, 64),
    "half-cylinder": _ring(0.048, 40, half=True),
}
SHAPES = tuple(_OUTLINES_m)
_HEIGHT_m = 0.090
_TAPER: Mapping[str, float] = {"tapered-cup": 0.75}
"""Size of the foot relative to the section at half the height; the top is as much larger."""


def body(shape: str) -> Body:
    """The body of a name. Raises ConfigurationError if there is none."""
    if shape not in _OUTLINES_m:
        hint = f"Available shapes: {', '.join(SHAPES)}"
        raise ConfigurationError(f"there is no shape {shape!r} in the second family", where="shape", hint=hint)
    outline, taper = _OUTLINES_m[shape], _TAPER.get(shape, 1.0)
    low = np.column_stack([taper * outline, np.zeros(len(outline))])
    high = np.column_stack([(2.0 - taper) * outline, np.full(len(outline), _HEIGHT_m)])
    following = np.roll(np.arange(len(outline)), -1)
    walls = [np.stack([low, low[following], high[following]], axis=1), np.stack([low, high[following], high], axis=1)]
    lid = _lid(outline)
    return Body(np.concatenate([*walls, low[lid[:, ::-1]], high[lid]]), outline, _HEIGHT_m)


def _lid(outline_m: Array) -> NDArray[np.intp]:
    """Triangles that fill a simple counter-clockwise polygon, by cutting off ears; shape (n - 2, 3)."""
    left, found = list(range(len(outline_m))), []
    while len(left) > 3:
        ear = next(i for i in range(len(left)) if _is_ear(outline_m, left, i))
        found.append([left[ear - 1], left[ear], left[(ear + 1) % len(left)]])
        del left[ear]
    return np.array([*found, left])


def _is_ear(outline_m: Array, left: list[int], at: int) -> bool:
    before, tip, after = (outline_m[left[(at + step) % len(left)]] for step in (-1, 0, 1))
    if _turn(before, tip, after) <= 0:
        return False
    others = [outline_m[i] for i in left if i not in (left[at - 1], left[at], left[(at + 1) % len(left)])]
    corners = ((before, tip), (tip, after), (after, before))
    return not any(all(_turn(one, two, point) >= 0 for one, two in corners) for point in others)


def _turn(one: Array, two: Array, three: Array) -> float:
    first, second = two - one, three - one
    return float(first[0] * second[1] - first[1] * second[0])


def simulate(
    shape: str, seed: int, *, dimension: int = 2, count: int = 16, wrong_share: float = 0.0, paths: bool = True
) -> SecondGrasps:
    """Grasps of a body that slips between them.

    Args:
        shape: one of :data:`SHAPES`.
        seed: of all random numbers.
        dimension: 2: all contacts at half the height, with errors in the plane; 3: at all heights and on the top.
        count: number of grasps.
        wrong_share: share of the contacts that are 15 mm off per axis, with a normal of any direction.
        paths: whether the approach paths are known.

    Raises:
        ConfigurationError: there is no such shape.
    """
    found = body(shape)
    bias_m = _BIAS_SIGMA_m * float(np.random.default_rng([seed, 77003, SHAPES.index(shape), dimension]).normal())
    hand = _Hand(found, np.random.default_rng([seed, 77003]), dimension, wrong_share, bias_m)
    grasps, truth = [], []
    for index in range(count):
        motion = hand.move() if index else Pose3()
        contacts, lines = hand.close()
        grasps.append(Grasp(index, index * 10**9, contacts, hand.palm(), motion, lines if paths else ()))
        truth.append(hand.world_T_body)
    return SecondGrasps(shape, tuple(grasps), tuple(truth), hand.body)


class _Hand:
    """Moves and grasps a body.

    Args:
        body: what is grasped.
        rng: source of all random numbers.
        dimension: 2 or 3, see :func:`simulate`.
        wrong_share: of the contacts.
        bias_m: how far outside of the surface its fingers feel all contacts.
    """

    def __init__(self, body: Body, rng: np.random.Generator, dimension: int, wrong_share: float, bias_m: float) -> None:
        self.body, self._rng, self._wrong_share, self._bias_m = body, rng, wrong_share, bias_m
        self._noisy = np.array([1.0, 1.0, float(dimension == 3)])
        self.world_T_body = _on_table(rng.normal(0.0, 0.04, 2), rng.uniform(-np.pi, np.pi))

    def palm(self) -> Pose3:
        """The palm above the body, turned at random by little."""
        return Pose3(Rot3.Rz(self._rng.normal(0.0, 0.1)), self.world_T_body.translation() + np.array([0.0, 0.0, 0.2]))

    def move(self) -> Pose3:
        """Carry the body, which slips, about a point near its middle; returns the hand's motion in the world."""
        turn_rad = self._rng.choice([-1.0, 1.0]) * np.deg2rad(self._rng.uniform(8.0, 30.0))
        shift_m = self._rng.uniform(-0.01, 0.01, 2)
        middle = Pose3(Rot3(), self.world_T_body.translation())
        motion = middle * _on_table(shift_m, turn_rad) * middle.inverse()
        x, y, yaw = self._heavy(_SLIP_FREEDOM, 3) * [SLIP_SIGMA_m, SLIP_SIGMA_m, SLIP_SIGMA_rad]
        self.world_T_body = motion * self.world_T_body * _on_table(np.array([x, y]), yaw)
        return motion

    def close(self) -> tuple[tuple[Contact, ...], tuple[ApproachPath, ...]]:
        """Five fingers from evenly spread directions, each on a straight line; a finger may miss."""
        common_m = PALM_SIGMA_m * self._noisy * self._rng.normal(size=3)
        first_rad = self._rng.uniform(0.0, 2 * np.pi)
        contacts, lines = [], []
        for number, finger in enumerate(FINGERS):
            start, way = self._line(first_rad + 2 * np.pi * number / 5 + self._rng.normal(0.0, 0.15), number)
            contact = self._touch(finger, start, way, common_m)
            end = start + (_START_m + _BEYOND_m) * way if contact is None else contact.point_world_m
            lines.append(ApproachPath(finger, start, end, touched=contact is not None))
            contacts += [contact] if contact is not None else []
        return tuple(contacts), tuple(lines)

    def _line(self, angle_rad: float, number: int) -> tuple[Array, Array]:
        """Start and direction in the world of a finger's path."""
        rng, height = self._rng, self.body.height_m
        aim = np.array([*rng.uniform(-0.015, 0.015, 2), height / 2])
        way = -np.array([np.cos(angle_rad), np.sin(angle_rad), 0.0])
        if self._noisy[2]:
            aim[2] = rng.uniform(0.08, 0.92) * height
            if number == 2:
                way, aim[2] = _unit(np.array([0.2 * way[0], 0.2 * way[1], -1.0])), height
        pose = self.world_T_body
        return np.asarray(pose.transformFrom(aim - _START_m * way)), np.asarray(pose.rotation().rotate(way))

    def _touch(self, finger: str, start: Array, way: Array, common_m: Array) -> Contact | None:
        pose, rng = self.world_T_body, self._rng
        found = _first_hit(self.body.triangles_m, pose.transformTo(start), pose.rotation().unrotate(way))
        if found is None:
            return None
        point, normal = np.asarray(pose.transformFrom(found[0])), np.asarray(pose.rotation().rotate(found[1]))
        own_m = OWN_SIGMA_m * self._heavy(_CONTACT_FREEDOM, 3)
        point = point + self._bias_m * normal + common_m + self._noisy * own_m
        normal = normal + self._noisy * NORMAL_SIGMA_rad * self._heavy(_CONTACT_FREEDOM, 3)
        if rng.random() < self._wrong_share:
            point, normal = point + self._noisy * rng.normal(0.0, _WRONG_m, 3), self._noisy * rng.normal(size=3)
        covariance_m2 = OWN_SIGMA_m**2 * np.eye(3) + _BIAS_COVARIANCE_m2
        given = finger, point, _unit(normal), covariance_m2, NORMAL_SIGMA_rad, _FORCE_N
        return Contact(*given, shared_covariance_m2=_BIAS_COVARIANCE_m2, shared_by_all=True)

    def _heavy(self, freedom: float, count: int) -> Array:
        """Numbers of Student's t distribution, of variance 1."""
        return np.asarray(self._rng.standard_t(freedom, count) * np.sqrt((freedom - 2.0) / freedom))


def _on_table(place_m: Array, yaw_rad: float) -> Pose3:
    return Pose3(Rot3.Rz(float(yaw_rad)), np.array([place_m[0], place_m[1], 0.0]))


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


def _first_hit(triangles_m: Array, start_m: Array, way: Array) -> tuple[Array, Array] | None:
    """Where a ray first enters a closed surface and the outward normal there; None if it does not.

    The volume coordinates of the hit within each triangle (Moeller and Trumbore 1997).
    """
    corner, along, beside = triangles_m[:, 0], *(triangles_m[:, k] - triangles_m[:, 0] for k in (1, 2))
    across = np.cross(way, beside)
    scale = np.sum(along * across, axis=1)
    usable = np.abs(scale) > _PARALLEL
    inverse = 1 / np.where(usable, scale, 1.0)
    gap = start_m - corner
    first = inverse * np.sum(gap * across, axis=1)
    turned = np.cross(gap, along)
    second, distance = inverse * (turned @ way), inverse * np.sum(beside * turned, axis=1)
    hit = usable & (first >= 0) & (second >= 0) & (first + second <= 1) & (distance > 0)
    if not hit.any():
        return None
    nearest = int(np.argmin(np.where(hit, distance, np.inf)))
    return start_m + distance[nearest] * way, _unit(np.cross(along[nearest], beside[nearest]))
