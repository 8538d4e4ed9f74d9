"""An outline as a surface that viewers can draw."""

from __future__ import annotations

from typing import Any

import numpy as np

from drivers.core.contacts import Array

_UP = np.array([0.0, 0.0, 1.0])


def wall(outline_m: Array, half_height_m: float, sigma_m: Array) -> tuple[Array, Any, Array]:
    """A vertical wall along a closed outline, from the table to twice the height of the contacts.

    Args:
        outline_m: shape (n, 3), its last point is next to its first.
        half_height_m: of the outline above the table.
        sigma_m: at its points, shape (n,).

    Returns:
        Vertices (2n, 3), triangles (2n, 3), and the standard deviation at each vertex (2n,).
    """
    count, up = len(outline_m), half_height_m * _UP
    here, after = np.arange(count), np.roll(np.arange(count), -1)
    faces = np.vstack(
        [np.column_stack([here, after, after + count]), np.column_stack([here, after + count, here + count])]
    )
    return np.vstack([outline_m - up, outline_m + up]), faces, np.concatenate([sigma_m, sigma_m])
