"""Contours as wild methods draw them still make solids that can be read again."""

from __future__ import annotations

import numpy as np

from tactile_lab.evaluation.prism import open_ring, prism


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
