"""Outline and surface of any function that is negative inside, for shape models that have one."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from tactile_lab.errors import ShapeError
from tactile_lab.geometry.contacts import Array
from tactile_lab.shape.field_grid import LARGEST_NODE_COUNT
from tactile_lab.shape.sampling import polygon_area
from tactile_lab.shape.surface import Contour, SurfaceMesh

Function: TypeAlias = Callable[[Array], Array]
_AT_ONCE = 1 << 17
_MARGIN_NODES = 2


def contour_of(value: Function, lower_m: Array, upper_m: Array, resolution_m: float, sigma: Function) -> Contour:
    """The longest outline of a planar function within a box, counter-clockwise.

    Args:
        value: of points of shape (n, 2), negative inside.
        lower_m, upper_m: of the box; the shape is cut where it goes beyond.
        resolution_m: spacing of the grid, between whose nodes the function is taken as linear.
        sigma: standard deviation of the outline at points of shape (n, 2).

    Raises:
        ShapeError: the shape is in space, there is no inside, or the grid would be too large.
    """
    from skimage.measure import find_contours  # here, so that importing this module stays quick

    _check_dimension(lower_m, 2)
    first, nodes, closed = _tabulated(value, lower_m, upper_m, resolution_m)
    loops = find_contours(nodes, 0.0, fully_connected="high")  # type: ignore[no-untyped-call]
    loop = max(loops, key=lambda each: abs(polygon_area(each)))[:-1]
    points = first + resolution_m * loop
    points = points if polygon_area(points) > 0 else points[::-1].copy()
    return Contour(points, sigma(points), closed)


def mesh_of(
    value: Function,
    lower_m: Array,
    upper_m: Array,
    resolution_m: float,
    sigma: Function,
    floor_m: float | None = None,
) -> SurfaceMesh:
    """The surface of a spatial function within a box; arguments and errors as :func:`contour_of`.

    What is below ``floor_m`` is cut off with a flat foot.
    """
    from skimage.measure import marching_cubes  # here, so that importing this module stays quick

    _check_dimension(lower_m, 3)

    def standing(points: Array) -> Array:
        return value(points) if floor_m is None else np.maximum(value(points), floor_m - points[:, 2])

    first, nodes, closed = _tabulated(standing, lower_m, upper_m, resolution_m)
    places, faces, _, _ = marching_cubes(nodes, 0.0, gradient_direction="descent", allow_degenerate=False)  # type: ignore[no-untyped-call]
    vertices = first + resolution_m * places.astype(float)
    faces = faces.astype(np.int64)
    return SurfaceMesh(vertices, faces, sigma(vertices), vertex_normals(vertices, faces), closed)


def vertex_normals(vertices: Array, faces: Array) -> Array:
    """Outward unit normals, of the faces around each vertex by their area."""
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], across)
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300))


def _check_dimension(lower_m: Array, wanted: int) -> None:
    if len(lower_m) != wanted:
        raise ShapeError(
            "contacts in space have a surface, no outline" if wanted == 2 else "contacts in the plane have no surface"
        )


def _tabulated(value: Function, lower_m: Array, upper_m: Array, resolution_m: float) -> tuple[Array, Array, bool]:
    """First node, values on the nodes with a positive border, and whether nothing was cut off there."""
    first = lower_m - _MARGIN_NODES * resolution_m
    counts = np.ceil((upper_m - lower_m) / resolution_m).astype(int) + 2 * _MARGIN_NODES + 1
    if np.prod(counts, dtype=float) > LARGEST_NODE_COUNT:
        raise ShapeError(
            f"a grid of {' x '.join(map(str, counts))} nodes is too large", hint="Choose a coarser resolution"
        )
    nodes = first + resolution_m * np.moveaxis(np.indices(tuple(counts)), 0, -1).reshape(-1, len(counts))
    blocks = [value(nodes[start : start + _AT_ONCE]) for start in range(0, len(nodes), _AT_ONCE)]
    values = np.concatenate(blocks).reshape(counts)
    if not (values < 0).any():
        raise ShapeError("the shape has no inside near the contacts", hint="Choose a finer resolution or more contacts")
    border = np.ones(values.shape, dtype=bool)
    border[(slice(1, -1),) * values.ndim] = False
    closed = not bool((values[border] < 0).any())
    values[border] = np.maximum(values[border], 1e-6 * resolution_m)
    return first, values, closed
