"""Where values on a regular grid change their sign: outlines in the plane, surfaces in space."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array

_OFF_NODE = 1e-6
"""Smallest value at a node, relative to the largest: through a node itself would go triangles without area."""
_EDGES = 4


def level_mesh(values: Array) -> tuple[Array, NDArray[np.int64]]:
    """The closed surface around nodes below zero, by marching cubes.

    Args:
        values: at the nodes, shape (n1, n2, n3), positive on all sides.

    Returns:
        Vertices in grid spacings from the first node, shape (n, 3), and triangles, counter-clockwise seen from outside.
    """
    import igl  # here, so that importing this module stays quick

    least = _OFF_NODE * np.abs(values).max()
    apart = np.where(np.abs(values) < least, np.copysign(least, values), values)
    places = np.moveaxis(np.indices(values.shape[::-1], dtype=float)[::-1], 0, -1)  # the first axis runs fastest
    count_x, count_y, count_z = values.shape
    vertices, faces, _ = igl.marching_cubes(apart.T.ravel(), places.reshape(-1, 3), count_x, count_y, count_z, 0.0)
    return np.asarray(vertices), np.asarray(faces, dtype=np.int64)


def level_outlines(values: Array) -> list[Array]:
    """The closed lines around nodes up to zero, by marching squares; nodes that only touch at a corner are apart.

    Args:
        values: at the nodes, shape (n1, n2), positive on all sides.

    Returns:
        Points of each line in grid spacings from the first node, shape (n, 2); the last joins the first.
    """
    followers = _followers(values <= 0)
    lines = []
    while followers:
        edge, line = next(iter(followers)), []
        while edge in followers:
            line.append(edge)
            edge = followers.pop(edge)
        lines.append(_crossings(values, np.array(line)))
    return lines


def _followers(inside: NDArray[np.bool_]) -> dict[int, int]:
    """Which crossed edge comes behind which.

    Around a cell its edges in turn leave the inside and enter it; a line goes from where it is left to where it was
    entered, around a corner that is inside.
    """
    rows, columns = inside.shape
    corners = [inside[:-1, :-1], inside[:-1, 1:], inside[1:, 1:], inside[1:, :-1]]
    left = np.stack([one & ~other for one, other in zip(corners, [*corners[1:], corners[0]], strict=True)])
    entered = np.stack([other & ~one for one, other in zip(corners, [*corners[1:], corners[0]], strict=True)])
    edge, row, column = np.nonzero(left)
    back = np.ones(len(edge), dtype=np.int64)
    for _ in range(_EDGES - 1):
        back += ~entered[(edge - back) % _EDGES, row, column]
    numbers = _edge_numbers(rows, columns)
    begin, end = numbers[edge, row, column], numbers[(edge - back) % _EDGES, row, column]
    return dict(zip(begin.tolist(), end.tolist(), strict=True))


def _edge_numbers(rows: int, columns: int) -> NDArray[np.int64]:
    """Of the four edges around each cell: those along rows first, then those along columns."""
    along_rows = np.arange(rows * (columns - 1)).reshape(rows, columns - 1)
    along_columns = along_rows.size + np.arange((rows - 1) * columns).reshape(rows - 1, columns)
    return np.stack([along_rows[:-1], along_columns[:, 1:], along_rows[1:], along_columns[:, :-1]])


def _crossings(values: Array, edges: NDArray[np.int64]) -> Array:
    """Where edges are crossed, by their numbers; shape (n, 2)."""
    rows, columns = values.shape
    first = rows * (columns - 1)
    upright = edges >= first
    row, column = np.divmod(np.where(upright, edges - first, edges), np.where(upright, columns, columns - 1))
    here, there = values[row, column], values[row + upright, column + ~upright]
    share = here / (here - there)
    return np.column_stack([row + share * upright, column + share * ~upright])


def without_small_bends(line: Array, tolerance: float) -> Array:
    """An open line of fewer points that stays within a tolerance of all of them (Douglas and Peucker 1973).

    Args:
        line: shape (n, d).
        tolerance: in its unit.
    """
    kept = np.zeros(len(line), dtype=bool)
    kept[[0, -1]] = True
    parts = [(0, len(line) - 1)]
    while parts:
        first, last = parts.pop()
        if last - first < 2:
            continue
        away = _distances(line[first + 1 : last], line[first], line[last])
        farthest = first + 1 + int(np.argmax(away))
        if away.max() > tolerance:
            kept[farthest] = True
            parts += [(first, farthest), (farthest, last)]
    return line[kept]


def _distances(points: Array, begin: Array, end: Array) -> Array:
    """Of points from the straight piece between two others."""
    along = end - begin
    length2 = float(along @ along)
    share = np.clip((points - begin) @ along / length2, 0.0, 1.0) if length2 > 0 else np.zeros(len(points))
    return np.asarray(np.linalg.norm(points - begin - share[:, None] * along, axis=1))
