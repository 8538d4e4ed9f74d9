"""Contours as wild methods draw them still make solids that can be read again."""

from __future__ import annotations

import numpy as np

from tactile_lab.evaluation.prism import open_ring, prism, triangulate
from tactile_lab.slam.shape.surfaces.sampling import polygon_area


def test_points_that_readers_take_for_one_are_one() -> None:
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    ring = 0.04 * np.column_stack([np.cos(angles), np.sin(angles)])
    doubled = np.insert(ring, [5, 11, 24], ring[[4, 10, 0]] + 1e-9, axis=0)
    kept = open_ring(doubled)
    assert len(kept) == 24
    vertices, faces = prism(kept, 0.0, 0.05)
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert np.all(np.unique(edges, axis=0, return_counts=True)[1] == 2)
    assert len(np.unique(np.round(vertices, 8), axis=0)) == 48


def test_the_fattest_corner_stays_where_its_triangle_holds_the_tip_of_a_notch() -> None:
    """Into the triangle of the long corner one of two notches reaches, between the legs on the other side."""
    ring = 0.01 * np.array([[0, 0], [10, 1], [0, 2], [-6, 2.5], [3, 1], [-6, -0.5], [-3, -0.2]])
    triangles = triangulate(ring)
    areas = [polygon_area(ring[triangle]) for triangle in triangles]
    assert len(triangles) == len(ring) - 2
    assert min(areas) > 0.0
    assert abs(sum(areas) - polygon_area(ring)) < 1e-12
