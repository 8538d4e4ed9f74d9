"""The surface between material and free cells as a watertight triangle mesh with a given resolution."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.solids.cells import BEYOND, Arrangement, Loop, Mask

Indices = NDArray[np.int64]

_FLIPS = 200


@dataclass(frozen=True)
class FacetMesh:
    """Triangles and the plane that each lies on.

    Attributes:
        vertices_m: shape (n, 3).
        triangles: shape (m, 3), counter-clockwise seen from outside.
        planes: index of each triangle's plane, shape (m,); negative for a side of the box.
    """

    vertices_m: Array
    triangles: Indices
    planes: Indices


def boundary(arrangement: Arrangement, material: Mask) -> FacetMesh:
    """The facets between material and free space, as fans of triangles. The surface is closed.

    Raises:
        ShapeError: no cell is material.
    """
    if not material.any():
        raise ShapeError("the planes enclose nothing", hint="More contacts are needed")
    material = _manifold(arrangement, material)
    triangles, planes = [], []
    for loop, plane in _outer_loops(arrangement, material):
        triangles += [(loop[0], loop[k], loop[k + 1]) for k in range(1, len(loop) - 1)]
        planes += [plane] * (len(loop) - 2)
    used, corners = np.unique(np.array(triangles, dtype=np.int64), return_inverse=True)
    return FacetMesh(arrangement.vertices_m[used], corners.reshape(-1, 3), np.array(planes, dtype=np.int64))


def _outer_loops(arrangement: Arrangement, material: Mask) -> list[tuple[Loop, int]]:
    """Facets of the surface, counter-clockwise seen from outside, with their planes."""
    loops = []
    for facet in arrangement.facets:
        below = bool(material[facet.below])
        above = facet.above != BEYOND and bool(material[facet.above])
        if below != above:
            loops.append((facet.loop if below else facet.loop[::-1], facet.plane))
    return loops


def _manifold(arrangement: Arrangement, material: Mask) -> Mask:
    """Labels without edges at which four facets meet: the smallest cell at such an edge gets the other label."""
    material = material.copy()
    for _ in range(_FLIPS):
        uses = Counter(edge for loop, _ in _outer_loops(arrangement, material) for edge in _edges(loop))
        crossed = {edge for edge, count in uses.items() if count > 2}
        if not crossed:
            return material
        edge = min(crossed)
        around = {
            cell
            for facet in arrangement.facets
            if edge in _edges(facet.loop)
            for cell in (facet.below, facet.above)
            if cell != BEYOND
        }
        smallest = min(around, key=lambda cell: float(arrangement.volumes_m3[cell]))
        material[smallest] = not material[smallest]
    raise ShapeError("the planes' surface crosses itself", hint="The contacts contradict each other")


def _edges(loop: Loop) -> list[tuple[int, int]]:
    return [(min(a, b), max(a, b)) for a, b in zip(loop, (*loop[1:], loop[0]), strict=True)]


def borders(mesh: FacetMesh) -> Indices:
    """Pairs of planes that end at each other, shape (k, 3): plane, the other plane, and 1 at a ridge or -1 in a notch.

    Every border is listed from both sides. Planes that meet both in ridges and in notches are left out.
    """
    _, edge_of = _numbered_edges(mesh.triangles)
    one, other = (np.argsort(edge_of.ravel(), kind="stable").reshape(-1, 2) // 3).T
    one, other = np.append(one, other), np.append(other, one)
    corners = mesh.vertices_m[mesh.triangles]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    height = np.einsum("ed,ed->e", outward[one], corners[other].mean(axis=1) - corners[one, 0])
    pairs = np.column_stack([mesh.planes[one], mesh.planes[other], np.where(height < 0, 1, -1)])
    found = np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)
    _, first, ways = np.unique(found[:, :2], axis=0, return_index=True, return_counts=True)
    return np.asarray(found[first[ways == 1]])


def refine(mesh: FacetMesh, longest_m: float) -> FacetMesh:
    """The same surface with edges of at most ``longest_m``: long edges are halved in both their triangles."""
    while True:
        ends, edge_of = _numbered_edges(mesh.triangles)
        long = np.linalg.norm(np.diff(mesh.vertices_m[ends], axis=1)[:, 0], axis=1) > longest_m
        if not long.any():
            return mesh
        middles = np.full(len(ends), -1)
        middles[long] = len(mesh.vertices_m) + np.arange(np.count_nonzero(long))
        vertices = np.vstack([mesh.vertices_m, mesh.vertices_m[ends[long]].mean(axis=1)])
        triangles, source = _divide(mesh.triangles, middles[edge_of], vertices)
        mesh = FacetMesh(vertices, triangles, mesh.planes[source])


def _numbered_edges(triangles: Indices) -> tuple[Indices, Indices]:
    """Ends of all edges, shape (e, 2), and the edge that follows each corner of each triangle, shape (m, 3)."""
    following = np.roll(triangles, -1, axis=1)
    pairs = np.sort(np.stack([triangles, following], axis=-1).reshape(-1, 2), axis=1)
    ends, number = np.unique(pairs, axis=0, return_inverse=True)
    return ends, number.reshape(-1, 3)


def _divide(triangles: Indices, middles: Indices, vertices: Array) -> tuple[Indices, Indices]:
    """Triangles split at the middles of their edges (-1 if not split), and the original triangle of each."""
    pieces, sources = [], []
    cuts = (middles >= 0).sum(axis=1)
    for count in range(4):
        rows = np.flatnonzero(cuts == count)
        if len(rows):
            for piece in _pattern(count, *_turn(triangles[rows], middles[rows], count), vertices):
                pieces.append(piece)
                sources.append(rows)
    return np.vstack(pieces), np.concatenate(sources)


def _turn(corners: Indices, middles: Indices, count: int) -> tuple[Indices, Indices]:
    """Rotate the corners so that a single split is on the first edge, and a single unsplit edge is the last."""
    is_cut = middles >= 0
    first = is_cut.argmax(axis=1) if count == 1 else (is_cut.argmin(axis=1) + 1) % 3
    order = (first[:, None] + np.arange(3)) % 3
    return np.take_along_axis(corners, order, axis=1), np.take_along_axis(middles, order, axis=1)


def _pattern(count: int, corners: Indices, middles: Indices, vertices: Array) -> list[Indices]:
    a, b, c = corners.T
    ab, bc, ca = middles.T
    if count == 0:
        return [corners]
    if count == 1:
        return [np.column_stack(rows) for rows in ((a, ab, c), (ab, b, c))]
    if count == 3:
        return [np.column_stack(rows) for rows in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    slanted = np.linalg.norm(vertices[ab] - vertices[c], axis=1) < np.linalg.norm(vertices[a] - vertices[bc], axis=1)
    third = np.where(slanted, c, bc)
    fourth = np.where(slanted, ab, a)
    return [np.column_stack(rows) for rows in ((ab, b, bc), (a, ab, third), (fourth, bc, c))]


def area_weighted_normals(mesh: FacetMesh) -> Array:
    """Outward unit normals at the vertices: the mean of the triangles around each, shape (n, 3)."""
    corners = mesh.vertices_m[mesh.triangles]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(mesh.vertices_m)
    for k in range(3):
        np.add.at(normals, mesh.triangles[:, k], areas)
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30))
