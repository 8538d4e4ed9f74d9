"""Silhouettes of a solid from the front and from above, as closed lines that a picture can show."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import trimesh
from scipy.ndimage import binary_closing

from drivers.core.contacts import Array
from tactile_lab.slam.shape.surfaces.level_sets import level_outlines, without_small_bends
from tactile_lab.slam.shape.surfaces.sampling import sample_mesh_with_normals

VIEWS = {"front": (0, 2), "above": (0, 1)}
"""Names of the views, and the axes that they show to the right and up."""

Lines: TypeAlias = list[list[list[float]]]
"""Closed lines of places (right, up), millimetres."""

_PIXEL_mm, _SAMPLES, _TOLERANCE_mm = 1.0, 60_000, 0.4
_BORDER = 4
_THROUGH_PIXELS = 0.999
"""Level of the outermost filled pixels' middles."""

_CLOSED = 2  # pixels between samples that are closed


def silhouettes(mesh: trimesh.Trimesh) -> dict[str, Lines]:
    """By the name of the view; vertices in metres."""
    points_mm = 1e3 * sample_mesh_with_normals(mesh, _SAMPLES)[0]
    return {name: _outlines(points_mm[:, axes]) for name, axes in VIEWS.items()}


def places(points_m: Array) -> dict[str, list[list[float]]]:
    """Points, shape (n, 3), as the views show them, millimetres."""
    return {name: _rounded(1e3 * points_m[:, axes]) for name, axes in VIEWS.items()}


def _outlines(points_mm: Array) -> Lines:
    """Around all places, shape (n, 2), on a grid of pixels."""
    low = points_mm.min(axis=0) - _BORDER * _PIXEL_mm
    indices = ((points_mm - low) / _PIXEL_mm).round().astype(int)
    filled = np.zeros(indices.max(axis=0) + _BORDER + 1, dtype=bool)
    filled[tuple(indices.T)] = True
    filled = binary_closing(filled, np.ones((2 * _CLOSED + 1,) * 2, dtype=bool))
    found = [np.vstack([line, line[:1]]) for line in level_outlines(_THROUGH_PIXELS - filled.astype(float))]
    lines = [without_small_bends(line, _TOLERANCE_mm / _PIXEL_mm) for line in found]
    return [_rounded(low + _PIXEL_mm * line) for line in lines if len(line) > 3]


def _rounded(places_mm: Array) -> list[list[float]]:
    return [[round(float(x), 1), round(float(y), 1)] for x, y in places_mm]
