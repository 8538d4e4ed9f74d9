"""Shapes only where the data support them: the parts of an outline or surface whose sigma is small enough."""

from __future__ import annotations

import numpy as np

from tactile_lab.shape.surface import Contour, SurfaceMesh


def supported_pieces(contour: Contour, largest_sigma_m: float) -> list[Contour]:
    """The parts of an outline known to ``largest_sigma_m`` or better, in order, as open lines.

    One piece with ``is_closed`` as it was if that is all of it; none if it is nothing.
    """
    good = contour.sigma_m <= largest_sigma_m
    if good.all():
        return [contour]
    opening = int(np.argmin(good))  # begin at a gap, so that no piece is cut by the end of the arrays
    order = np.roll(np.arange(len(good)), -opening)
    starts = np.flatnonzero(good[order] & ~good[np.roll(order, 1)])
    ends = np.flatnonzero(good[order] & ~good[np.roll(order, -1)])
    rows = [order[start : end + 1] for start, end in zip(starts, ends, strict=True)]
    return [Contour(contour.points_m[row], contour.sigma_m[row], is_closed=False) for row in rows]


def supported_share(contour: Contour, largest_sigma_m: float) -> float:
    """Share of an outline's length known to ``largest_sigma_m`` or better, 0 to 1."""
    lengths = np.linalg.norm(np.roll(contour.points_m, -1, axis=0) - contour.points_m, axis=1)
    good = contour.sigma_m <= largest_sigma_m
    return float(lengths[good & np.roll(good, -1)].sum() / lengths.sum())


def supported_mesh(mesh: SurfaceMesh, largest_sigma_m: float) -> SurfaceMesh:
    """The faces of a surface all of whose vertices are known to ``largest_sigma_m`` or better; open where it is cut."""
    good = mesh.sigma_m <= largest_sigma_m
    if good.all():
        return mesh
    faces = mesh.faces[good[mesh.faces].all(axis=1)]
    used = np.unique(faces)
    renumbered = np.zeros(len(good), dtype=np.int64)
    renumbered[used] = np.arange(len(used))
    return SurfaceMesh(mesh.vertices[used], renumbered[faces], mesh.sigma_m[used], mesh.normals[used], False)
