"""Labels the cells of an arrangement as material or free, by the evidence in every cell and the area between them.

The labels are the exact minimum of an energy in nats, found as a minimum cut (Chauve, Labatut and Pons 2010 use the
same for buildings). There are three kinds of evidence: each contact has material just behind it and a fingertip in
front of it; places that a finger passed are free; and elsewhere the field gives the probability of material. Without
evidence the smaller surface wins.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, maximum_flow
from scipy.special import log_ndtr

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.field_grid import Field
from tactile_lab.slam.shape.solids.cells import BEYOND, Arrangement, Mask
from tactile_lab.slam.shape.solids.planes import Planes

CONTACT_DEPTHS_m = (0.001, 0.004, 0.008)
"""Distances behind and in front of a contact at which there is material and free space; a fingertip is larger."""
_BEHIND_nats, _BEFORE_nats = (4.0, 1.0, 0.5), (4.0, 2.0, 1.0)
_FREE_nats = 1.5
_AREA_nats_per_m2 = 3000.0
_FIELD_SPACING_m = 0.010
_FIELD_nats_per_m3 = 1e6
_LARGEST_ODDS = 3.0
_CERTAIN_nats = 1e5
_FLOW_UNITS_PER_nat = 100.0
_FOOT_m = 1e-6


def label_cells(
    arrangement: Arrangement,
    planes: Planes,
    contacts_m: Array,
    field: Field,
    free_points_m: Array,
    floor_m: float | None,
) -> Mask:
    """The cells that are material, shape (c,).

    Args:
        arrangement: its first planes are those of ``planes``, in the same order.
        planes: with the plane of each contact; negative labels for contacts on none of them.
        contacts_m: shape (n, 3).
        field: a fitted field, for the parts far from contacts.
        free_points_m: places that a finger passed, shape (k, 3).
        floor_m: height of the table, the lower side of the box; None if the object stands on nothing.
    """
    odds = _field_odds(arrangement, field)
    odds += _contact_odds(arrangement, planes, contacts_m)
    odds -= _FREE_nats * _counts(arrangement, free_points_m)
    odds[_open_cells(arrangement, floor_m)] = -_CERTAIN_nats
    material = _minimum_cut(arrangement, odds, floor_m)
    return _one_body(arrangement, material, odds)


def _counts(arrangement: Arrangement, points_m: Array) -> Array:
    """Number of the points in each cell, shape (c,)."""
    cells = arrangement.locate(points_m)
    return np.bincount(cells[cells != BEYOND], minlength=arrangement.cell_count).astype(float)


def _contact_odds(arrangement: Arrangement, planes: Planes, contacts_m: Array) -> Array:
    """Log odds by contacts, which are first moved onto their planes so that noise does not put them on the wrong
    side.
    """
    kept = planes.labels >= 0
    labels, points = planes.labels[kept], contacts_m[kept]
    normals = planes.normals[labels]
    on_plane = points - (np.sum(points * normals, axis=1) - planes.offsets_m[labels])[:, None] * normals
    odds = np.zeros(arrangement.cell_count)
    for depth_m, behind, before in zip(CONTACT_DEPTHS_m, _BEHIND_nats, _BEFORE_nats, strict=True):
        odds += behind * _counts(arrangement, on_plane - depth_m * normals)
        odds -= before * _counts(arrangement, on_plane + depth_m * normals)
    return odds


def _field_odds(arrangement: Arrangement, field: Field) -> Array:
    """Log odds of material from the field: the mean over grid points in the cell, times the cell's volume."""
    lower, upper = arrangement.vertices_m.min(axis=0), arrangement.vertices_m.max(axis=0)
    counts = np.maximum(np.round((upper - lower) / _FIELD_SPACING_m).astype(int), 1)
    steps = (np.moveaxis(np.indices(counts), 0, -1).reshape(-1, 3) + 0.5) / counts
    grid = lower + (upper - lower) * steps
    cells = arrangement.locate(grid)
    seen = np.bincount(cells[cells != BEYOND], minlength=arrangement.cell_count)
    unseen = np.flatnonzero(seen == 0)
    points, cells = np.vstack([grid, arrangement.centres_m[unseen]]), np.append(cells, unseen)
    found = field.predict(points[cells != BEYOND], variance=True)
    ratio = found.mean_m / np.sqrt(found.variance_m2)
    odds = np.clip(log_ndtr(-ratio) - log_ndtr(ratio), -_LARGEST_ODDS, _LARGEST_ODDS)
    sums = np.bincount(cells[cells != BEYOND], odds, minlength=arrangement.cell_count)
    return np.asarray(_FIELD_nats_per_m3 * arrangement.volumes_m3 * sums / np.maximum(seen, 1))


def _open_cells(arrangement: Arrangement, floor_m: float | None) -> NDArray[np.int64]:
    """Cells at the sides of the box, except the floor: the object does not extend there."""
    sides = [
        facet.below
        for facet in arrangement.facets
        if facet.above == BEYOND and not _is_foot(arrangement.vertices_m[list(facet.loop)], floor_m)
    ]
    return np.unique(np.array(sides, dtype=np.int64))


def _is_foot(corners_m: Array, floor_m: float | None) -> bool:
    return floor_m is not None and bool(np.abs(corners_m[:, 2] - floor_m).max() < _FOOT_m)


def _minimum_cut(arrangement: Arrangement, odds: Array, floor_m: float | None) -> Mask:
    """Labels that minimize ``sum of odds against the label + cost of the area between different labels``."""
    count = arrangement.cell_count
    source, sink = count, count + 1
    inner = [k for k, facet in enumerate(arrangement.facets) if facet.above != BEYOND]
    below = np.array([arrangement.facets[k].below for k in inner], dtype=np.int64)
    above = np.array([arrangement.facets[k].above for k in inner], dtype=np.int64)
    price = _AREA_nats_per_m2 * arrangement.areas_m2[inner]
    cells = np.arange(count)
    rows = np.concatenate([np.full(count, source), cells, below, above])
    columns = np.concatenate([cells, np.full(count, sink), above, below])
    capacities = np.concatenate([np.maximum(odds, 0), np.maximum(-odds, 0), price, price])
    units = np.minimum(np.round(_FLOW_UNITS_PER_nat * capacities), np.iinfo(np.int32).max // 4).astype(np.int32)
    graph = coo_array((units, (rows, columns)), shape=(count + 2, count + 2)).tocsr()
    left = graph - maximum_flow(graph, source, sink).flow
    left.data = np.maximum(left.data, 0)
    left.eliminate_zeros()
    reached = breadth_first_order(left, source, return_predecessors=False)
    material = np.zeros(count + 2, dtype=bool)
    material[reached] = True
    return material[:count]


def _one_body(arrangement: Arrangement, material: Mask, odds: Array) -> Mask:
    """The connected part with most evidence, with its cavities filled."""
    if not material.any():
        return material
    body = _parts(arrangement, material)
    gains = np.bincount(body[material], np.maximum(odds[material], 0.0))
    material = material & (body == gains.argmax())
    outer = _parts(arrangement, ~material)
    sides = {outer[facet.below] for facet in arrangement.facets if facet.above == BEYOND and not material[facet.below]}
    return np.asarray(material | ~np.isin(outer, list(sides)))


def _parts(arrangement: Arrangement, chosen: Mask) -> NDArray[np.int64]:
    """Number of the connected part that each cell belongs to; cells not chosen are parts of their own."""
    links = [
        (facet.below, facet.above)
        for facet in arrangement.facets
        if facet.above != BEYOND and chosen[facet.below] and chosen[facet.above]
    ]
    rows, columns = np.array(links, dtype=np.int64).reshape(-1, 2).T
    size = (arrangement.cell_count, arrangement.cell_count)
    graph = coo_array((np.ones(len(links)), (rows, columns)), shape=size)
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
