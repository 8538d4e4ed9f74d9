"""The estimate as plain data, for recording and viewers: its surface, and how far to trust it."""

from __future__ import annotations

from typing import Any

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.autonomy.variance_planner import KnownShape
from tactile_lab.slam.doubt.assessment import Assessment


def surface_message(known: KnownShape | None) -> dict[str, Any]:
    """The surface in the object frame, with the standard deviation at each vertex.

    It is the one that the planner uses. An outline (dimension 2) is closed and has no faces. Without a closed shape
    there are no vertices.
    """
    if known is None:
        return _message(2, np.zeros((0, 3)), np.zeros((0, 3), dtype=int), np.zeros(0), 0.0, 0.0)
    if known.surface is None:
        nothing = np.zeros((0, 3)), np.zeros((0, 3), dtype=int), np.zeros(0)
        return _message(known.dimension, *nothing, known.explored, known.origin_height_m)
    vertices_m, faces = known.surface.points_m, known.surface.cells
    if known.dimension == 2:
        vertices_m, faces = np.pad(vertices_m, ((0, 0), (0, 1))), np.zeros((0, 3), dtype=int)
    return _message(known.dimension, vertices_m, faces, known.surface.sigma_m, known.explored, known.origin_height_m)


def trust_message(found: Assessment) -> dict[str, Any]:
    """The status, the share of the shape that was touched, and doubts and alternatives as sentences."""
    return {
        "status": found.status,
        "known_share": found.known_share,
        "doubts": [doubt.words for doubt in found.doubts],
        "alternatives": [one.words() for one in found.alternatives],
    }


def _message(
    dimension: int, vertices_m: Array, faces: Any, sigma_m: Array, explored: float, height_m: float
) -> dict[str, Any]:
    return {
        "dimension": dimension,
        "vertices_m": np.round(vertices_m, 5).tolist(),
        "faces": np.asarray(faces).tolist(),
        "sigma_m": np.round(sigma_m, 6).tolist(),
        "explored": explored,
        "origin_height_m": height_m,
    }
