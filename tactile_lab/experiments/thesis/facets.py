"""Surfaces as triangles in a picture, seen from the side and above in parallel projection."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.experiments.cells import Row
from tactile_lab.experiments.experiment import PlotOf
from tactile_lab.experiments.plot_data import Plot, SurfacePanel

_AZIMUTH_rad, _ELEVATION_rad = np.deg2rad(-60.0), np.deg2rad(28.0)
_TOWARDS = np.array(
    [
        np.cos(_AZIMUTH_rad) * np.cos(_ELEVATION_rad),
        np.sin(_AZIMUTH_rad) * np.cos(_ELEVATION_rad),
        np.sin(_ELEVATION_rad),
    ]
)
"""Direction from the object to the observer."""
_RIGHT = np.array([-np.sin(_AZIMUTH_rad), np.cos(_AZIMUTH_rad), 0.0])
_SHARP_rad = np.deg2rad(30.0)
_PICTURE = np.column_stack([_RIGHT, np.cross(_TOWARDS, _RIGHT)])


def in_picture(points_m: Array) -> list[list[float]]:
    """Points of shape (n, 3) as x to the right and y up in the picture, millimetres."""
    return [[round(x, 1), round(y, 1)] for x, y in (1e3 * points_m @ _PICTURE).tolist()]


def faces_observer(normals: Array) -> Array:
    """Which of these directions, shape (n, 3), point towards the observer."""
    return np.asarray(normals @ _TOWARDS > 0)


def facets(vertices_m: Array, faces: NDArray[np.integer[Any]], shades: Array) -> list[list[float]]:
    """The triangles that face the observer, from the back to the front, as rows of a surface panel.

    Args:
        vertices_m: shape (n, 3), z up.
        faces: vertex indices, counter-clockwise seen from outside, shape (m, 3).
        shades: of the vertices, from 0 (light) to 1 (dark), shape (n,).
    """
    corners = vertices_m[faces]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    seen = np.flatnonzero(outward @ _TOWARDS > 0)
    ordered = seen[np.argsort(corners[seen].mean(axis=1) @ _TOWARDS)]
    flat = (1e3 * corners[ordered] @ _PICTURE).reshape(-1, 6)
    rows: list[list[float]] = np.column_stack(
        [flat.round(1), np.median(shades[faces[ordered]], axis=1).round(2)]
    ).tolist()
    return rows


def edges(mesh: trimesh.Trimesh) -> list[list[float]]:
    """The sharp edges of a solid, as rows of a surface panel."""
    sharp = mesh.face_adjacency_edges[mesh.face_adjacency_angles > _SHARP_rad]
    ends = in_picture(mesh.vertices[sharp.ravel()])
    return [[*first, *second] for first, second in zip(ends[::2], ends[1::2], strict=True)]


def between_0_and_1(values: Array) -> Array:
    """Values stretched so that the smallest is 0 and the largest 1; all 0 if they are equal."""
    span = float(np.ptp(values)) if len(values) else 0.0
    return np.asarray((values - values.min()) / span if span > 0 else np.zeros(len(values)))


def surfaces(panel_of: Any, key: str, *, columns: int = 3) -> PlotOf:
    """The lowest seed's surfaces, a panel for each run.

    Args:
        panel_of: title of a run's panel, from its cell.
        key: what the shade means.
        columns: panels in a row.
    """

    def plot(rows: Sequence[Row]) -> Plot:
        lowest = min(row.cell.seed for row in rows)
        shown = [row for row in rows if row.cell.seed == lowest and row.figures is not None]
        return Plot(tuple(_panel(panel_of(row.cell), (row.figures or {})["picture"]) for row in shown), columns, key)

    return plot


def _panel(title: str, picture: dict[str, Any]) -> SurfacePanel:
    names = tuple((str(text), x, y) for text, x, y in picture.get("names", ()))
    drawn, lines, dots = (tuple(map(tuple, picture[part])) for part in ("facets", "edges", "dots"))
    return SurfacePanel(title, drawn, lines, dots, names)
