"""Occupancy grid: for each cell the log odds that it belongs to the object.

A contact marks cells behind it as occupied and cells in front of it as free, with a weight that decreases with
distance. Places that fingertips passed are free regardless of contacts. Unobserved cells that are enclosed by occupied
ones belong to the object.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.baselines.implicit import contour_of_nodes, mesh_of_nodes
from tactile_lab.slam.shape.baselines.scattered import distance_sigma
from tactile_lab.slam.shape.fields.field_grid import LARGEST_NODE_COUNT
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

CELL_m = {2: 0.003, 3: 0.005}
"""Edge of a cell in the plane and in space."""

FREE = -20.0
"""Log odds of a cell that a fingertip passed."""

_ACROSS_m = 0.012
"""Range of a contact's influence along the surface."""
_INWARD_m = 0.030
"""Range of a contact's influence along its normal."""
_OCCUPIED, _EMPTY = 2.0, 6.0
"""Log odds that one contact gives to a cell next to it, behind and in front; the fingertip was certainly in front."""
_UNTOLD = -0.7
"""Log odds of an unobserved cell."""
_MARGIN_CELLS = 6
_CLOSED_OVER_m = 0.020
"""Gaps up to about twice this between occupied cells are closed before the inside is filled."""


@dataclass(frozen=True)
class OccupancyShape:
    """A :class:`FittedShape`; its resolution is always that of its cells.

    Attributes:
        first_m: centre of the first cell, shape (d,).
        cell_m: edge of a cell.
        log_odds: shape (n1, n2) or (n1, n2, n3), positive where the object is.
        contacts_m: shape (n, d).
        point_sigma_m: mean standard deviation of the contacts.
    """

    first_m: Array
    cell_m: float
    log_odds: Array
    contacts_m: Array
    point_sigma_m: float
    name: str = "occupancy"
    log_evidence: None = None

    @classmethod
    def of(
        cls, points_m: Array, normals: Array, point_sigma_m: Array, free_points_m: Array | None = None
    ) -> OccupancyShape:
        """Make the grid from contacts of shape (n, d) and places known to be free, shape (q, d).

        Raises:
            ShapeError: the contacts are so far apart that the grid would be too large.
        """
        cell_m = CELL_m[points_m.shape[1]]
        lower = points_m.min(axis=0) - _MARGIN_CELLS * cell_m
        counts = np.ceil(np.ptp(points_m, axis=0) / cell_m).astype(int) + 2 * _MARGIN_CELLS + 1
        if np.prod(counts, dtype=float) > LARGEST_NODE_COUNT:
            raise ShapeError(f"a grid of {' x '.join(map(str, counts))} cells is too large", hint="Check the units")
        cells = lower + cell_m * np.moveaxis(np.indices(tuple(counts)), 0, -1)
        log_odds = _contact_log_odds(cells, points_m, normals, cell_m)
        free = _passed_cells(counts, lower, cell_m, free_points_m)
        log_odds = _fill(log_odds, free, cell_m)
        return cls(lower, cell_m, log_odds, points_m, float(point_sigma_m.mean()))

    def contour(self, resolution_m: float = 0.001) -> Contour:
        return contour_of_nodes(self.first_m, -self.log_odds, self.cell_m, self._sigma)

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        return mesh_of_nodes(self.first_m, -self.log_odds, self.cell_m, self._sigma, floor_m)

    def _sigma(self, places_m: Array) -> Array:
        own = float(np.hypot(self.point_sigma_m, self.cell_m / np.sqrt(12)))
        return distance_sigma(places_m, self.contacts_m, own)


def _contact_log_odds(cells: Array, points_m: Array, normals: Array, cell_m: float) -> Array:
    """Log odds from contacts alone; linear in the distance near a contact's plane, so that the surface is not bound to
    the cells' borders.
    """
    log_odds = np.full(cells.shape[:-1], _UNTOLD)
    for point, normal in zip(points_m, normals, strict=True):
        offset = cells - point
        height = offset @ normal
        sideways = np.sqrt(np.maximum(np.sum(offset**2, axis=-1) - height**2, 0.0))
        weight = np.exp(-((sideways / _ACROSS_m) ** 2) - (height / _INWARD_m) ** 2)
        log_odds -= weight * np.where(height > 0, _EMPTY, _OCCUPIED) * np.clip(height / cell_m, -1.0, 1.0)
    return log_odds


def _passed_cells(
    counts: NDArray[np.int64], lower: Array, cell_m: float, free_points_m: Array | None
) -> NDArray[np.bool_]:
    """Cells with centres around a free place, so that the interpolated surface does not contain the place either."""
    passed = np.zeros(tuple(counts), dtype=bool)
    if free_points_m is not None and len(free_points_m):
        below = np.floor((free_points_m - lower) / cell_m).astype(int)
        for corner in np.ndindex((2,) * len(lower)):
            index = below + corner
            index = index[((index >= 0) & (index < counts)).all(axis=1)]
            passed[tuple(index.T)] = True
    return passed


def _fill(log_odds: Array, free: NDArray[np.bool_], cell_m: float) -> Array:
    """Fill unobserved cells that are enclosed; passed cells stay free."""
    reach = int(np.ceil(_CLOSED_OVER_m / cell_m))
    occupied = np.pad((log_odds > 0) & ~free, reach)
    grown = ndimage.distance_transform_edt(~occupied) <= reach
    closed = ndimage.distance_transform_edt(ndimage.binary_fill_holes(grown)) > reach
    inner = (slice(reach, -reach),) * log_odds.ndim
    inside = (ndimage.binary_fill_holes(occupied) | closed)[inner] & (log_odds > 2 * _UNTOLD)
    raised = np.where(inside, np.maximum(log_odds, -_UNTOLD), log_odds)
    return np.where(free, FREE, raised)
