"""Walls of a pot."""

from __future__ import annotations

import numpy as np
import pytest

from tactile_lab.experiments.data.household import turned
from tactile_lab.slam.shape.solids.walls import Walls
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh

POT = turned([0, 36, 36, 31, 31, 0], [0, 0, 80, 80, 5, 5])


def pot() -> SurfaceMesh:
    vertices, normals = np.asarray(POT.vertices), np.asarray(POT.vertex_normals)
    faces = np.asarray(POT.faces, dtype=np.int64)
    return SurfaceMesh(vertices, faces, np.zeros(len(vertices)), normals, is_closed=True)


def test_floor_and_rim_are_no_walls() -> None:
    places_m = np.array([[0.0, 0.0, 0.04], [0.0335, 0.0, 0.04], [0.040, 0.0, 0.04], [0.0, 0.0, 0.005]])
    assert Walls.of(pot()).distances_m(places_m) == pytest.approx([0.031, 0.0025, 0.004, 0.031], abs=3e-4)


def test_walls_that_face_away_from_the_middle_are_the_outer_ones() -> None:
    away_m, ways = Walls.of(pot()).facing_away(np.zeros(3)).away(np.array([[0.020, 0.0, 0.04]]))
    assert away_m == pytest.approx([0.016], abs=3e-4)
    assert ways[0] == pytest.approx([-1.0, 0.0, 0.0], abs=0.1)


def test_nothing_is_near_walls_that_are_not_there() -> None:
    walls = Walls.of(pot())
    assert np.isinf(Walls(walls.vertices, walls.faces[:0]).distances_m(np.zeros((2, 3)))).all()
