"""Makes faces parallel or perpendicular if the contacts allow it.

Directions that are uncertain by some degrees each are determined better together. Two faces, or two groups of faces,
share one direction up to quarter turns if the increase of chi-square is less than the penalty for a further direction:
the narrowing of a prior over a quarter turn by the contacts. So the evidence decides, and a clearly oblique face keeps
its direction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.shape.planar.runs import chi_square_at, fit_direction, most_gained, turn_back
from tactile_lab.slam.shape.planar.segmentation import Faces, PlanarContacts
from tactile_lab.slam.shape.regularities import offsets_of_faces

_QUARTER_rad = np.pi / 2

_LONERS = 3.0
"""Prior weight of a separate direction for a face, relative to joining one other face."""


@dataclass(frozen=True)
class _Group:
    """Faces that share a direction up to quarter turns.

    Attributes:
        faces: their numbers.
        turns: quarter turns from the shared direction to that of each face.
        moments: moments of all faces, see :func:`tactile_lab.slam.shape.planar.runs.chi_square_at`.
        angle_rad: the best shared direction.
    """

    faces: tuple[int, ...]
    turns: tuple[int, ...]
    moments: Array
    angle_rad: float


def with_right_angles(contacts: PlanarContacts, faces: Faces) -> Faces:
    """The same faces, made parallel or perpendicular if the evidence allows it."""
    groups, gained = [_alone(contacts, faces, face) for face in range(faces.count)], 0.0
    while (found := _most_gained(groups)) is not None:
        gain, *pair = found
        gained += gain
        joined = _join(groups[pair[0]], groups[pair[1]])
        groups = [group for i, group in enumerate(groups) if i not in pair] + [joined]
    regular = _assemble(contacts, faces, groups)
    return replace(regular, regularity_nats=0.5 * (gained + regular.chi_square - faces.chi_square))


def _alone(contacts: PlanarContacts, faces: Faces, face: int) -> _Group:
    members = faces.members(face)
    weights, stiffness = contacts.point_sigma_m[members] ** -2.0, contacts.normal_sigma_rad[members] ** -2.0
    points = contacts.points_m[members]
    away = points - weights @ points / weights.sum()
    (xx, xy), (_, yy) = (away * weights[:, None]).T @ away
    moments = np.array([xx, xy, yy, *(stiffness @ contacts.normals[members]), 2 * stiffness.sum()])
    return _Group((face,), (0,), moments, float(faces.directions_rad[face]))


def _most_gained(groups: list[_Group]) -> tuple[float, int, int] | None:
    """The largest gain in chi-square by letting two groups share a direction, and these two; None if there is none."""
    moments, angles = np.array([group.moments for group in groups]), np.array([group.angle_rad for group in groups])
    sizes = np.array([float(len(group.faces)) for group in groups])
    found = most_gained(moments.reshape(-1, 6), angles, sizes, _LONERS)
    return found if found[0] > 0 else None


def _join(one: _Group, other: _Group) -> _Group:
    turns = round((other.angle_rad - one.angle_rad) / _QUARTER_rad)
    moments = one.moments + turn_back(other.moments, turns)
    turned = tuple(turn + turns for turn in other.turns)
    return _Group(one.faces + other.faces, one.turns + turned, moments, fit_direction(*moments[:5]))


def _assemble(contacts: PlanarContacts, faces: Faces, groups: list[_Group]) -> Faces:
    directions = np.array(faces.directions_rad)
    numbers = np.empty(faces.count, dtype=np.int64)
    for number, group in enumerate(groups):
        members = np.array(group.faces)
        directions[members] = group.angle_rad + _QUARTER_rad * np.array(group.turns)
        numbers[members] = number
    directions = np.arctan2(np.sin(directions), np.cos(directions))
    normals = np.column_stack([np.cos(directions), np.sin(directions)])
    offsets = offsets_of_faces(contacts.points_m, contacts.point_sigma_m, faces.labels, normals)
    chi_square = sum(chi_square_at(group.angle_rad, group.moments) for group in groups)
    return replace(faces, directions_rad=directions, offsets_m=offsets, chi_square=chi_square, direction_groups=numbers)
