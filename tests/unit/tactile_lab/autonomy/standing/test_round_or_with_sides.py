"""Boxes and round things are told apart by contacts, also where contacts are on edges."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.autonomy.standing.felt_object import FeltObject
from tactile_lab.autonomy.standing.roundness import is_round

_HALF_m = np.array([0.049, 0.0225])


def _ways(angles: Array) -> Array:
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _on_box(shares: Array, off_rad: float) -> tuple[Array, Array]:
    """Contacts on all sides of a box, at shares of their half length; the normals of those on edges are off."""
    places, normals = [], []
    for face in range(4):
        out, along = _ways(np.array([face * np.pi / 2, (face + 1) * np.pi / 2]))
        for share in shares:
            places.append(out * _HALF_m[face % 2] + share * along * _HALF_m[1 - face % 2])
            normals.append(face * np.pi / 2 + np.sign(share) * off_rad * (abs(share) > 0.9))
    return np.array(places), _ways(np.array(normals))


def test_a_box_touched_on_most_of_its_edges_is_not_round() -> None:
    """On average normals are 20 degrees off: a box taken for round has its corners grasped, which looks round again."""
    points_m, normals = _on_box(np.array([-0.97, 0.2, 0.97]), np.radians(30.0))
    assert not is_round(points_m, normals, np.zeros(2), 0.0)


@pytest.mark.parametrize("neck_m", [0.034, 0.015])
def test_a_tin_and_a_bottle_are_round_from_eight_contacts_on(neck_m: float) -> None:
    angles = np.radians(np.array([10.0, 60, 100, 140, 200, 215, 290, 330]))
    radii_m = np.where(np.arange(8) < 6, 0.034, neck_m)
    middle_m = np.array([0.1, -0.05])
    points_m = middle_m + radii_m[:, None] * _ways(angles)
    assert is_round(points_m, _ways(angles), middle_m + 0.004, np.radians(20.0))


def test_what_was_pinched_square_once_is_taken_for_a_box() -> None:
    normals = np.array([[1.0, 0, 0], [1, 0, 0], [1, 0, 0], [-1, 0, 0]])
    points_m = 0.034 * normals + np.array([[0.0, 0, 0.06], [0, 0, 0.08], [0, 0, 0.1], [0, 0, 0.08]])
    assert not FeltObject.around(np.zeros(2), 0.12, points_m, normals).is_round


def test_what_is_round_is_grasped_between_the_sides_of_its_box_too() -> None:
    angles = np.radians(np.arange(0.0, 360.0, 36.0) + 10.0)
    normals = np.column_stack([_ways(angles), np.zeros(10)])
    points_m = 0.034 * normals + np.array([0.0, 0.0, 0.06])
    felt = FeltObject.around(np.zeros(2), 0.12, points_m, normals)
    assert felt.is_round
    assert len(felt.yaws((-1.0, 1.0))) > 2
