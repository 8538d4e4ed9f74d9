"""Convex pieces are merged with their neighbours, but never over a place that is kept out."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from drivers.simulation.convex_patches import merge_neighbours

NOWHERE = np.empty((0, 3))


def cube(x: float, z: float = 0.0) -> Array:
    """Corners of a cube of 10 mm."""
    return np.array([(0.01 * (x + i), 0.01 * j, 0.01 * (z + k)) for i in (0, 1) for j in (0, 1) for k in (0, 1)])


ROW = [cube(0), cube(1), cube(2)]
BESIDE = np.array([[0, 1], [1, 2]])


def test_a_row_becomes_one_piece_with_no_corners_inside() -> None:
    (merged,) = merge_neighbours(ROW, BESIDE, NOWHERE)
    assert len(merged) == 8
    assert np.ptp(merged, axis=0) == pytest.approx([0.03, 0.01, 0.01])


def test_a_corner_that_must_stay_free_is_not_filled() -> None:
    corner = [cube(0), cube(1), cube(1, 1)]
    assert len(merge_neighbours(corner, BESIDE, NOWHERE)) == 1
    free = np.array([[0.008, 0.005, 0.012]])
    merged = merge_neighbours(corner, BESIDE, free)
    assert sorted(len(piece) for piece in merged) == [8, 8]


def test_a_place_on_the_surface_is_not_inside() -> None:
    assert len(merge_neighbours(ROW, BESIDE, np.array([[0.015, 0.005, 0.01]]))) == 1


def test_only_neighbours_are_merged() -> None:
    assert len(merge_neighbours(ROW, BESIDE[:1], NOWHERE)) == 2
    assert len(merge_neighbours(ROW, np.empty((0, 2), dtype=int), NOWHERE)) == 3
