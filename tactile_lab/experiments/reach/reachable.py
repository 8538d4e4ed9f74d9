"""Which places of an object's surface a fingertip can get to, by the hand's geometry alone.

A place is in reach if the hand can take up some posture of one of its closings, taps or touches, or with one finger
down inside something, in which a fingertip meets it, with palm, forearm, links and all other fingertips clear of object
and table there and on the way in. Neither what was planned nor what was touched matters, nor whether the object would
tip over, nor whether a planner offers that action for an object like this. So the lowest part of a deep cup's inside is
out of reach, where the knuckles meet the rim before a fingertip gets there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from drivers.core.contacts import Array
from drivers.shadow.closing.closing import LEANING, PRESHAPES, SIDEWAYS, Closing, closing
from drivers.shadow.closing.collision_spheres import link_balls
from drivers.shadow.closing.finger_down import LEANS_rad, finger_down
from drivers.shadow.closing.hand_envelope import open_hand
from drivers.shadow.closing.posture import PROGRESS, HandShape
from sessions.motion.probing.touch_patterns import COLUMN, TAP, TAP_HEIGHT_m
from tactile_lab.slam.shape.selection.unexplained import are_inside
from tactile_lab.slam.shape.surfaces.sampling import distances_to_mesh

Mask: TypeAlias = NDArray[np.bool_]

_HEIGHTS_m = tuple(np.arange(0.015, 0.115, 0.011).round(3).tolist())
"""Of closings from above: the palm is nearer to the fingertips in high ones."""

_LOW_m, _AROUND_m = 0.03, 0.0056
"""A posture from the side or of a touch is the same at every height; one from above counts half a step up and down."""

ANY_YAW_rad = (-np.pi, np.pi)
"""Of an object that the hand turns as it likes."""

_NODES = range(0, len(PROGRESS), 2)
_YAWS = 24
_DENTED_m = 0.002
"""Balls stand for the hand's parts: so deep in something is no collision yet."""

_STEEPEST = -0.5
"""Cosine between a fingertip's way and the surface's normal: beyond 60 degrees it slips aside."""

_WAY_m = (0.02, 0.05, 0.09, 0.13)
_ANY_HEIGHT_m = (0.0, np.inf)
_DOWN = np.array([0.0, 0.0, -1.0])

_FROM_WALL_m = 0.010
"""A finger goes down so far from the wall that it then touches."""

_GRID_m, _MARGIN_m = 0.004, 0.02
_AT_ONCE = 20_000


@dataclass(frozen=True)
class _Posture:
    """The hand as a fingertip meets something; grasp frame, raised or lowered as needed.

    Attributes:
        tip_m: the fingertip's centre.
        balls_m, radii_m: all else of the hand, shapes (n, 3), (n,).
        way: the direction in which the fingertip comes, unit.
        opened_m, opened_radii_m: all of the hand on its way in.
        before_m: where the opened hand is on its way in, seen from there, shape (k, 3).
        heights_m: lowest and highest that the fingertip's centre may be.
    """

    tip_m: Array
    balls_m: Array
    radii_m: Array
    way: Array
    opened_m: Array
    opened_radii_m: Array
    before_m: Array
    heights_m: tuple[float, float]


class SignedGrid:
    """Signed distances to a closed mesh, by interpolation; from farther away those to the box around it."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        self._bounds_m = np.asarray(mesh.bounds)
        self._low_m = self._bounds_m[0] - _MARGIN_m
        counts = np.ceil((self._bounds_m[1] + _MARGIN_m - self._low_m) / _GRID_m).astype(int) + 1
        places_m = self._low_m + _GRID_m * np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), -1)
        flat_m = places_m.reshape(-1, 3)
        values_m = np.where(are_inside(flat_m, mesh), -1.0, 1.0) * distances_to_mesh(flat_m, mesh)
        self._values_m = values_m.reshape(counts)

    def distances_m(self, places_m: Array) -> Array:
        """Of places (..., 3), shape (...)."""
        beyond_m = np.maximum(self._bounds_m[0] - places_m, places_m - self._bounds_m[1])
        found_m = np.linalg.norm(np.maximum(beyond_m, 0.0), axis=-1)
        near = found_m < _MARGIN_m
        at = ((places_m[near] - self._low_m) / _GRID_m).T
        found_m[near] = map_coordinates(self._values_m, at, order=1, mode="nearest")
        return np.asarray(found_m)


def are_in_reach(
    mesh: trimesh.Trimesh, points_m: Array, normals: Array, yaws_rad: Sequence[tuple[float, float]], hand: HandShape
) -> Mask:
    """Which places of a standing object's surface, shape (n, 3) with outward normals, a fingertip can get to.

    Args:
        mesh: the object, its lowest point on the table.
        points_m, normals: of the places.
        yaws_rad: of the hand, from lowest to highest, seen from the object; all that it can take up.
        hand: its form, and the shape of its fingertips.
    """
    grid, floor_m = SignedGrid(mesh), float(mesh.bounds[0][2])
    tips_m = points_m + hand.radius_m * normals
    fits = (grid.distances_m(tips_m) > hand.radius_m - _DENTED_m) & (tips_m[:, 2] > floor_m + hand.radius_m - _DENTED_m)
    turns = [_turn(yaw) for yaw in 2 * np.pi * np.arange(_YAWS) / _YAWS if _is_allowed(yaw, yaws_rad)]
    found = np.zeros(len(points_m), dtype=bool)
    for posture in _postures(hand):
        for turn in turns:
            wanted = np.flatnonzero(fits & ~found & (normals @ (turn @ posture.way) < _STEEPEST))
            heights_m = tips_m[wanted, 2] - floor_m
            wanted = wanted[(heights_m >= posture.heights_m[0]) & (heights_m <= posture.heights_m[1])]
            if len(wanted):
                found[wanted] = _is_clear(grid, floor_m, posture, turn, tips_m[wanted])
    return found


def _is_clear(grid: SignedGrid, floor_m: float, posture: _Posture, turn: Array, tips_m: Array) -> Mask:
    """Whether nothing of the hand is in object or table with the fingertip at these places, shape (n,)."""
    moves_m = tips_m - turn @ posture.tip_m
    balls_m, opened_m = posture.balls_m @ turn.T, posture.opened_m @ turn.T
    lowest_m = (balls_m[:, 2] - posture.radii_m).min()
    clear = np.asarray(moves_m[:, 2] + lowest_m > floor_m - _DENTED_m)
    for places_m, radii_m in [(balls_m, posture.radii_m)] + [
        (opened_m + away_m, posture.opened_radii_m) for away_m in posture.before_m @ turn.T
    ]:
        for rows in np.array_split(np.flatnonzero(clear), 1 + clear.sum() * len(radii_m) // (100 * _AT_ONCE)):
            apart_m = grid.distances_m(moves_m[rows, None] + places_m) - radii_m
            clear[rows] = (apart_m > -_DENTED_m).all(axis=1)
    return clear


def _postures(hand: HandShape) -> Iterator[_Posture]:
    for name in SIDEWAYS:
        table = closing(name, _LOW_m, hand)
        yield from _closing_postures(table, np.inf, hand)
        for finger in {table.fingers[0], table.fingers[-2]}:
            yield _held_posture(table, COLUMN.progress, finger, hand)
    tap = closing(TAP.closing, TAP_HEIGHT_m, hand)
    for finger in tap.fingers:
        yield _held_posture(tap, TAP.progress, finger, hand)
    for height_m in _HEIGHTS_m:
        for name in (*PRESHAPES, *LEANING):
            yield from _closing_postures(closing(name, height_m, hand), _AROUND_m, hand)
    yield from _inside_postures(hand)


def _closing_postures(table: Closing, around_m: float, hand: HandShape) -> Iterator[_Posture]:
    """Each finger closed so far, the others open; so far higher or lower."""
    usable = link_balls(table.name, table.height_m, hand).usable
    opened, first = open_hand(table.name, table.height_m, hand), np.argmax(usable, axis=0)
    for index, finger in enumerate(table.fingers):
        path = table.path(finger)
        for node in _NODES:
            if usable[node, index]:
                nodes = first.copy()
                nodes[index] = node
                height_m = float(path.centre_m(PROGRESS[node])[2])
                parts = _parts(table, nodes, index, hand)
                heights_m = height_m - around_m, height_m + around_m
                way = path.direction
                yield _Posture(*parts, way, opened.centres_m, opened.radii_m, _straight(table), heights_m)


def _held_posture(table: Closing, progress: Mapping[str, float], finger: str, hand: HandShape) -> _Posture:
    """All fingers at a progress of their own while the hand moves."""
    nodes = np.array([round(progress[f] * (len(PROGRESS) - 1)) for f in table.fingers])
    parts = _parts(table, nodes, table.fingers.index(finger), hand)
    return _Posture(*parts, np.array(table.approach), *parts[1:], _straight(table), _ANY_HEIGHT_m)


def _straight(table: Closing) -> Array:
    """The way of a hand that comes straight to a closing."""
    return np.outer(_WAY_m, -np.array(table.approach))


def _inside_postures(hand: HandShape) -> Iterator[_Posture]:
    """One finger down, onto a floor and, from a little aside, against a wall."""
    up_m = np.outer((0.0, *_WAY_m), [0.0, 0.0, 1.0])
    for posture in (finger_down(lean_rad, hand) for lean_rad in LEANS_rad):
        rest = posture.balls_m, posture.radii_m
        yield _Posture(posture.tip_m, *rest, _DOWN, *rest, up_m, _ANY_HEIGHT_m)
        aside_m = up_m - _FROM_WALL_m * posture.ahead
        yield _Posture(posture.tip_m, *rest, posture.ahead, *rest, aside_m, _ANY_HEIGHT_m)


def _parts(table: Closing, nodes: NDArray[np.intp], index: int, hand: HandShape) -> tuple[Array, Array, Array]:
    """One fingertip's centre, and centres and radii of all else of the hand."""
    links, opened = link_balls(table.name, table.height_m, hand), open_hand(table.name, table.height_m, hand)
    tips_m = np.array([table.path(f).centre_m(PROGRESS[n]) for f, n in zip(table.fingers, nodes, strict=True)])
    others_m = np.delete(tips_m, index, axis=0)
    links_m = links.centres_m[nodes[links.fingers], np.arange(len(links.fingers))]
    palm = slice(len(opened.radii_m) - len(links_m) - len(tips_m))
    balls_m = np.concatenate([opened.centres_m[palm], links_m, others_m])
    radii_m = np.concatenate([opened.radii_m[palm], links.radii_m, np.full(len(others_m), hand.radius_m)])
    return tips_m[index], balls_m, radii_m


def _turn(yaw_rad: float) -> Array:
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _is_allowed(yaw_rad: float, windows_rad: Sequence[tuple[float, float]]) -> bool:
    return any((yaw_rad - low) % (2 * np.pi) <= high - low for low, high in windows_rad)
