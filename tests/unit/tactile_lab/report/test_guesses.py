"""The guessed part of an outline in the top view."""

from __future__ import annotations

import numpy as np
import pytest

from tactile_lab.report.figures import _pieces

RING = np.column_stack([np.arange(6.0), np.zeros(6)])


@pytest.mark.parametrize(
    ("chosen", "pieces"),
    [
        ((), []),
        ((1, 2), [[1, 2, 3]]),
        ((0, 1, 4), [[4, 5], [0, 1, 2]]),
        ((5, 0), [[5, 0, 1]]),
        (range(6), [[0, 1, 2, 3, 4, 5, 0]]),
    ],
)
def test_guessed_segments_are_connected_lines_also_across_the_first_point(
    chosen: tuple[int, ...], pieces: list[list[int]]
) -> None:
    mask = np.isin(np.arange(6), list(chosen))
    found = [piece[:, 0].astype(int).tolist() for piece in _pieces(RING, mask)]
    assert sorted(found) == sorted(pieces)
