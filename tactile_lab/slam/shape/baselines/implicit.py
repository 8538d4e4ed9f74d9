"""Outline and surface of any function that is negative inside, for shape models that define one."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.field_grid import LARGEST_NODE_COUNT
from tactile_lab.slam.shape.surfaces.level_sets import level_mesh, level_outlines
from tactile_lab.slam.shape.surfaces.sampling import polygon_area
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

Function: TypeAlias = Callable[[Array], Array]
_AT_ONCE = 1 << 17
_MARGIN_NODES = 2


def contour_of(value: Function, lower_m: Array, upper_m: Array, resolution_m: float, sigma: Function) -> Contour:
    """The longest outline of a planar function within a box, counter-clockwise.

    Args:
        value: of points of shape (n, 2), negative inside.
        lower_m, upper_m: corners of the box, at which the shape is cut off.
        resolution_m: spacing of the grid; the function is interpolated linearly between nodes.
        sigma: standard deviation of the outline at points of shape (n, 2).

    Raises:
        ShapeError: the function is spatial, has no inside, or the grid would be too large.
    """
    _check_dimension(lower_m, 2)
    first, nodes = _tabulate(value, lower_m, upper_m, resolution_m)
    return contour_of_nodes(first, nodes, resolution_m, sigma)


def contour_of_nodes(first_m: Array, nodes: Array, resolution_m: float, sigma: Function) -> Contour:
    """As :func:`contour_of`, from values on a grid whose first node is at ``first_m``."""
    _check_dimension(first_m, 2)
    body, closed = _one_body(nodes, resolution_m)
    loop = max(level_outlines(body), key=lambda each: abs(polygon_area(each)))
    points = first_m + resolution_m * loop
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

    The part below ``floor_m`` is cut off, leaving a flat foot.
    """
    _check_dimension(lower_m, 3)
    first, nodes = _tabulate(value, lower_m, upper_m, resolution_m)
    return mesh_of_nodes(first, nodes, resolution_m, sigma, floor_m)


def mesh_of_nodes(
    first_m: Array, nodes: Array, resolution_m: float, sigma: Function, floor_m: float | None = None
) -> SurfaceMesh:
    """As :func:`mesh_of`, from values on a grid whose first node is at ``first_m``."""
    _check_dimension(first_m, 3)
    if floor_m is not None:
        nodes = np.maximum(nodes, floor_m - first_m[2] - resolution_m * np.arange(nodes.shape[2]))
    body, closed = _one_body(nodes, resolution_m)
    places, triangles = level_mesh(body)
    vertices = first_m + resolution_m * places
    return SurfaceMesh(vertices, triangles, sigma(vertices), vertex_normals(vertices, triangles), closed)


def vertex_normals(vertices: Array, faces: NDArray[np.int64]) -> Array:
    """Outward unit normals: the area-weighted mean of the faces around each vertex."""
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


def _tabulate(value: Function, lower_m: Array, upper_m: Array, resolution_m: float) -> tuple[Array, Array]:
    """The first node, and values on the nodes of the box and a small margin around it."""
    first = lower_m - _MARGIN_NODES * resolution_m
    counts = np.ceil((upper_m - lower_m) / resolution_m).astype(int) + 2 * _MARGIN_NODES + 1
    if np.prod(counts, dtype=float) > LARGEST_NODE_COUNT:
        raise ShapeError(
            f"a grid of {' x '.join(map(str, counts))} nodes is too large", hint="Choose a coarser resolution"
        )
    nodes = first + resolution_m * np.moveaxis(np.indices(tuple(counts)), 0, -1).reshape(-1, len(counts))
    blocks = [value(nodes[start : start + _AT_ONCE]) for start in range(0, len(nodes), _AT_ONCE)]
    return first, np.concatenate(blocks).reshape(counts)


def _one_body(nodes: Array, resolution_m: float) -> tuple[Array, bool]:
    """The largest region of negative nodes, with cavities filled and a positive border; and whether the border cut
    nothing.
    """
    labels, _ = ndimage.label(nodes < 0)
    sizes = np.bincount(labels.ravel())
    if len(sizes) < 2:
        raise ShapeError("the shape has no inside near the contacts", hint="Choose a finer resolution or more contacts")
    body = ndimage.binary_fill_holes(labels == sizes[1:].argmax() + 1)
    border = np.ones(nodes.shape, dtype=bool)
    border[(slice(1, -1),) * nodes.ndim] = False
    size = np.maximum(np.abs(nodes), 1e-6 * resolution_m)
    return np.where(body & ~border, -size, size), not bool((body & border).any())
