"""Faces of a made object that are parallel or at right angles, where the contacts do not object.

Directions known to some degrees each are known better together. Two faces, or two groups of them, share one direction
up to quarter turns if that costs less chi-square than one direction more is worth: the narrowing of a prior over a
quarter turn by the contacts. So it is the evidence that decides, and a face that is clearly askew keeps its direction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaln

from tactile_lab.geometry.contacts import Array
from tactile_lab.shape.polygon_segmentation import Faces, PlanarContacts

_QUARTER_rad = np.pi / 2

_LONERS = 3.0
"""Prior weight of a face of its own direction against joining one other face."""


@dataclass(frozen=True)
class _Group:
    """Faces that share a direction up to quarter turns.

    Attributes:
        faces: their numbers.
        turns: quarter turns from the shared direction to each one's own.
        scatter, pull, constant: ``u' scatter u - 2 u' pull + constant`` is the chi-square of all at the direction u.
        angle_rad: the best shared direction.
    """

    faces: tuple[int, ...]
    turns: tuple[int, ...]
    scatter: Array
    pull: Array
    constant: float
    angle_rad: float

    @property
    def chi_square(self) -> float:
        u = np.array([np.cos(self.angle_rad), np.sin(self.angle_rad)])
        return float(u @ self.scatter @ u - 2 * u @ self.pull + self.constant)

    @property
    def sigma_rad(self) -> float:
        """Standard deviation of the shared direction."""
        c, s = np.cos(self.angle_rad), np.sin(self.angle_rad)
        across = np.array([-s, c])
        return float((across @ self.scatter @ across + np.array([c, s]) @ self.pull) ** -0.5)


def with_right_angles(contacts: PlanarContacts, faces: Faces) -> Faces:
    """The same faces, those that may be parallel or at right angles to each other made so."""
    groups = [_alone(contacts, faces, face) for face in range(faces.count)]
    while (pair := _best_pair(groups)) is not None:
        first, second, joined = pair
        groups = [group for i, group in enumerate(groups) if i not in (first, second)] + [joined]
    return _assembled(contacts, faces, groups)


def _alone(contacts: PlanarContacts, faces: Faces, face: int) -> _Group:
    members = faces.members(face)
    weights, stiffness = contacts.point_sigma_m[members] ** -2.0, contacts.normal_sigma_rad[members] ** -2.0
    points = contacts.points_m[members]
    away = points - weights @ points / weights.sum()
    scatter = (away * weights[:, None]).T @ away
    pull = stiffness @ contacts.normals[members]
    return _Group((face,), (0,), scatter, pull, 2 * float(stiffness.sum()), float(faces.directions_rad[face]))


def _best_pair(groups: list[_Group]) -> tuple[int, int, _Group] | None:
    """The two groups that gain most by sharing a direction, and what they make together."""
    best: tuple[float, int, int, _Group] | None = None
    for second in range(len(groups)):
        for first in range(second):
            joined = _joined(groups[first], groups[second])
            price = _price_of_direction(groups[first], groups[second])
            gain = price - (joined.chi_square - groups[first].chi_square - groups[second].chi_square)
            if gain > 0 and (best is None or gain > best[0]):
                best = gain, first, second, joined
    return best[1:] if best else None


def _price_of_direction(one: _Group, other: _Group) -> float:
    """Chi-square that a direction of its own must save.

    From a prior over a quarter turn, and one over the ways to group faces (the Chinese restaurant process): few large
    groups are likely, a lone pair among many faces is likely chance.
    """
    sigma = np.hypot(one.sigma_rad, other.sigma_rad)
    narrowing = np.log(max(_QUARTER_rad / (np.sqrt(2 * np.pi) * sigma), 1.0))
    sizes = len(one.faces), len(other.faces)
    grouping = gammaln(sum(sizes)) - gammaln(sizes[0]) - gammaln(sizes[1]) - np.log(_LONERS)
    return 2 * float(narrowing + grouping)


def _joined(one: _Group, other: _Group) -> _Group:
    from tactile_lab.shape.polygon_runs import fit_direction  # here: compiled loops are slow to import

    turns = round((other.angle_rad - one.angle_rad) / _QUARTER_rad)
    turned = _turned(other, turns)
    scatter, pull = one.scatter + turned.scatter, one.pull + turned.pull
    angle = fit_direction(scatter[0, 0], scatter[0, 1], scatter[1, 1], pull[0], pull[1])
    return _Group(
        one.faces + turned.faces, one.turns + turned.turns, scatter, pull, one.constant + turned.constant, angle
    )


def _turned(group: _Group, turns: int) -> _Group:
    """The same group described by a direction that is so many quarter turns back."""
    back = np.linalg.matrix_power(np.array([[0.0, 1.0], [-1.0, 0.0]]), turns % 4)
    return replace(
        group,
        turns=tuple(turn + turns for turn in group.turns),
        scatter=back @ group.scatter @ back.T,
        pull=back @ group.pull,
        angle_rad=group.angle_rad - turns * _QUARTER_rad,
    )


def _assembled(contacts: PlanarContacts, faces: Faces, groups: list[_Group]) -> Faces:
    directions = np.array(faces.directions_rad)
    numbers = np.empty(faces.count, dtype=np.int64)
    for number, group in enumerate(groups):
        members = np.array(group.faces)
        directions[members] = group.angle_rad + _QUARTER_rad * np.array(group.turns)
        numbers[members] = number
    directions = np.arctan2(np.sin(directions), np.cos(directions))
    normals = np.column_stack([np.cos(directions), np.sin(directions)])
    weights = contacts.point_sigma_m**-2.0
    heights = np.sum(contacts.points_m * normals[faces.labels], axis=1)
    totals = np.bincount(faces.labels, weights, faces.count)
    offsets = np.bincount(faces.labels, weights * heights, faces.count) / totals
    chi_square = sum(group.chi_square for group in groups)
    return replace(faces, directions_rad=directions, offsets_m=offsets, chi_square=chi_square, direction_groups=numbers)
