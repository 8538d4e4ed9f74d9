"""The arrangement of planes within a box: convex cells, and the convex facets between them.

Cells, facets, edges and vertices form one complex. A plane splits each edge, facet and cell that it meets exactly once,
so that neighbours share identical parts and every surface made of facets is closed.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError

Mask = NDArray[np.bool_]

BOX_PLANE = -1
"""Plane number of the facets of the surrounding box."""
BEYOND = -1
"""Cell number of the space beyond the box."""

LARGEST_CELL_COUNT = 20_000
_APART_m = 1e-8
"""Planes are shifted by about this distance, each by a different amount, so that no four of them meet in one point."""

Loop = tuple[int, ...]


@dataclass(frozen=True)
class Facet:
    """A convex piece of a plane between two cells.

    Attributes:
        loop: vertices, counter-clockwise seen from the plane's positive side.
        plane: index of its plane, or :data:`BOX_PLANE`.
        below, above: cells on the plane's negative and positive side.
    """

    loop: Loop
    plane: int
    below: int
    above: int


@dataclass(frozen=True)
class Arrangement:
    """All cells of some planes within a box.

    Attributes:
        vertices_m: shape (v, 3).
        facets: all facets, those of the box included; their positive side is :data:`BEYOND`.
        signs: for each cell its side of each plane, shape (c, S), True for the positive side.
        normals, offsets_m: of the planes, shapes (S, 3) and (S,).
        centres_m: a point inside each cell, shape (c, 3).
        volumes_m3: shape (c,).
        areas_m2: of the facets, shape (f,).
    """

    vertices_m: Array
    facets: tuple[Facet, ...]
    signs: Mask
    normals: Array
    offsets_m: Array
    centres_m: Array
    volumes_m3: Array
    areas_m2: Array

    @property
    def cell_count(self) -> int:
        return len(self.signs)

    def locate(self, points_m: Array) -> NDArray[np.int64]:
        """The cell of each point of shape (q, 3); :data:`BEYOND` for points outside all cells."""
        places = {row.tobytes(): index for index, row in enumerate(self.signs)}
        above = points_m @ self.normals.T > self.offsets_m
        within = np.all((points_m >= self.vertices_m.min(axis=0)) & (points_m <= self.vertices_m.max(axis=0)), axis=1)
        cells = [places.get(row.tobytes(), BEYOND) if ok else BEYOND for row, ok in zip(above, within, strict=True)]
        return np.array(cells, dtype=np.int64)


def arrange(normals: Array, offsets_m: Array, lower_m: Array, upper_m: Array) -> Arrangement:
    """Divide a box by planes ``normal . x = offset``.

    Args:
        normals, offsets_m: shapes (S, 3) and (S,).
        lower_m, upper_m: corners of the box, each of shape (3,).

    Raises:
        ShapeError: more than :data:`LARGEST_CELL_COUNT` cells.
    """
    complex_ = _Complex(lower_m, upper_m)
    offsets_m = offsets_m + _APART_m * np.modf(np.arange(1, len(offsets_m) + 1) * 0.6180339887498949)[0]
    for plane, (normal, offset_m) in enumerate(zip(normals, offsets_m, strict=True)):
        complex_.split(plane, normal, float(offset_m))
    return complex_.finish(normals, offsets_m)


class _Complex:
    """The arrangement under construction. Facets are replaced by their halves; a cell keeps its number on the negative
    side.
    """

    def __init__(self, lower_m: Array, upper_m: Array) -> None:
        corners = np.array([lower_m, upper_m])
        self.vertices = [
            np.array([corners[k, axis] for axis, k in enumerate(sides)]) for sides in product((0, 1), repeat=3)
        ]
        loops = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        self.facets: list[Facet | None] = [Facet(loop, BOX_PLANE, 0, BEYOND) for loop in loops]
        self.cells: list[set[int]] = [set(range(6))]

    def split(self, plane: int, normal: Array, offset_m: float) -> None:
        """Split everything that the plane meets."""
        heights = np.array(self.vertices) @ normal - offset_m
        self._heights = heights
        self._cuts: dict[tuple[int, int], int] = {}
        seams: dict[int, list[tuple[int, int]]] = {}
        halves: dict[int, tuple[int, int]] = {}
        above = (heights > 0).tolist()
        for number, facet in enumerate(list(self.facets)):
            if facet is None:
                continue
            sides = [above[v] for v in facet.loop]
            if any(sides) and not all(sides):
                seam, halves[number] = self._split_facet(number, facet, above)
                for cell in (facet.below, facet.above):
                    if cell != BEYOND:
                        seams.setdefault(cell, []).append(seam)
        for cell, edges in seams.items():
            self._split_cell(cell, edges, halves, plane, normal, above)

    def _split_facet(self, number: int, facet: Facet, above: list[bool]) -> tuple[tuple[int, int], tuple[int, int]]:
        """Replace a facet by its halves below and above; returns the ends of the seam and the numbers of the halves."""
        below_loop: list[int] = []
        above_loop: list[int] = []
        seam: list[int] = []
        for here, following in zip(facet.loop, (*facet.loop[1:], facet.loop[0]), strict=True):
            (above_loop if above[here] else below_loop).append(here)
            if above[here] != above[following]:
                cut = self._cut(here, following)
                seam.append(cut)
                below_loop.append(cut)
                above_loop.append(cut)
        if len(seam) != 2:
            raise ShapeError("planes that almost coincide cannot be arranged", hint="Merge them first")
        self.facets[number] = None
        self.facets.append(Facet(tuple(below_loop), facet.plane, facet.below, facet.above))
        self.facets.append(Facet(tuple(above_loop), facet.plane, facet.below, facet.above))
        return (seam[0], seam[1]), (len(self.facets) - 2, len(self.facets) - 1)

    def _cut(self, a: int, b: int) -> int:
        """The vertex at which the plane meets an edge, shared by all facets at the edge."""
        edge = (min(a, b), max(a, b))
        if edge not in self._cuts:
            share = self._heights[edge[0]] / (self._heights[edge[0]] - self._heights[edge[1]])
            self._cuts[edge] = len(self.vertices)
            self.vertices.append(self.vertices[edge[0]] + share * (self.vertices[edge[1]] - self.vertices[edge[0]]))
        return self._cuts[edge]

    def _split_cell(
        self,
        cell: int,
        seam: list[tuple[int, int]],
        halves: dict[int, tuple[int, int]],
        plane: int,
        normal: Array,
        above: list[bool],
    ) -> None:
        """Divide a cell; the part above gets a new number, and the section becomes a facet between them."""
        upper = len(self.cells)
        if upper >= LARGEST_CELL_COUNT:
            raise ShapeError(f"{plane + 1} planes make too many cells", hint="Use fewer planes")
        sides: tuple[set[int], set[int]] = (set(), set())
        for number in self.cells[cell]:
            if number in halves:
                sides[0].add(halves[number][0])
                sides[1].add(halves[number][1])
            else:
                facet = self.facets[number]
                assert facet is not None
                sides[int(above[facet.loop[0]])].add(number)
        for number in sides[1]:
            self.facets[number] = _hand_over(self.facets[number], cell, upper)
        section = len(self.facets)
        self.facets.append(Facet(self._orient(_chain(seam), normal), plane, cell, upper))
        self.cells[cell] = sides[0] | {section}
        self.cells.append(sides[1] | {section})

    def _orient(self, loop: Loop, normal: Array) -> Loop:
        corners = np.array([self.vertices[v] for v in loop])
        return loop if _areas(corners[None])[0] @ normal > 0 else loop[::-1]

    def finish(self, normals: Array, offsets_m: Array) -> Arrangement:
        vertices = np.array(self.vertices)
        facets = tuple(facet for facet in self.facets if facet is not None)
        centres = np.array([vertices[self._corners(cell)].mean(axis=0) for cell in self.cells])
        vectors = _area_vectors(vertices, facets)
        return Arrangement(
            vertices_m=vertices,
            facets=facets,
            signs=centres @ normals.T > offsets_m,
            normals=normals,
            offsets_m=offsets_m,
            centres_m=centres,
            volumes_m3=_volumes(vertices, facets, vectors, centres),
            areas_m2=np.linalg.norm(vectors, axis=1),
        )

    def _corners(self, cell: set[int]) -> list[int]:
        loops = [facet.loop for number in sorted(cell) if (facet := self.facets[number]) is not None]
        return sorted({vertex for loop in loops for vertex in loop})


def _hand_over(facet: Facet | None, old: int, new: int) -> Facet:
    assert facet is not None
    if facet.below == old:
        return Facet(facet.loop, facet.plane, new, facet.above)
    return Facet(facet.loop, facet.plane, facet.below, new)


def _chain(edges: list[tuple[int, int]]) -> Loop:
    """The closed loop that some edges form."""
    neighbours: dict[int, list[int]] = {}
    for a, b in edges:
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    loop = [edges[0][0], edges[0][1]]
    while len(loop) < len(edges):
        first, second = neighbours[loop[-1]]
        loop.append(second if first == loop[-2] else first)
    return tuple(loop)


def _area_vectors(vertices: Array, facets: tuple[Facet, ...]) -> Array:
    """Normals of facets, with their areas as lengths, shape (m, 3)."""
    counts, vectors = np.array([len(facet.loop) for facet in facets]), np.empty((len(facets), 3))
    for count in np.unique(counts):
        alike = np.flatnonzero(counts == count)
        vectors[alike] = _areas(vertices[np.array([facets[at].loop for at in alike])])
    return vectors


def _areas(corners: Array) -> Array:
    """Normals of planar polygons of shape (m, k, 3), with their areas as lengths, shape (m, 3).

    A body has thousands of them, for each of which numpy's own cross product takes three times as long.
    """
    arms = corners[:, 1:] - corners[:, :1]
    (ahead, back), (next_ahead, next_back) = _rolled(arms[:, :-1]), _rolled(arms[:, 1:])
    return np.asarray(0.5 * (ahead * next_back - back * next_ahead).sum(axis=1))


def _rolled(vectors: Array) -> tuple[Array, Array]:
    """Vectors (..., 3) with their components rolled to y, z, x and to z, x, y."""
    return vectors.take((1, 2, 0), axis=-1), vectors.take((2, 0, 1), axis=-1)


def _volumes(vertices: Array, facets: tuple[Facet, ...], vectors: Array, centres: Array) -> Array:
    """Volumes of the cells, as sums of pyramids from their centres to their facets."""
    volumes = np.zeros(len(centres))
    for facet, vector in zip(facets, vectors, strict=True):
        foot = vertices[facet.loop[0]]
        volumes[facet.below] += vector @ (foot - centres[facet.below]) / 3
        if facet.above != BEYOND:
            volumes[facet.above] += vector @ (centres[facet.above] - foot) / 3
    return volumes
