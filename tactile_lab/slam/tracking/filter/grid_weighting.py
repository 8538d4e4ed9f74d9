"""The calibrated likelihood of very many particles from a tabulated field, in one compiled pass without temporaries.

The same formulas as :class:`tactile_lab.slam.tracking.filter.measurement.CalibratedMeasurement`, which is the readable
form for any field; a test compares both. Import it late, see :mod:`tactile_lab.slam.compiled`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.compiled import compile_when_called
from tactile_lab.slam.shape.fields.field_grid import FieldGrid
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet


@dataclass(frozen=True)
class LikelihoodConstants:
    """Numbers of the calibrated likelihood.

    Attributes:
        smallest_slope: distances are not divided by less.
        normal_length_m: a map uncertain by sigma predicts normals to ``sigma / normal_length_m``.
        outlier_density: density of an uninformative contact, in the same units as the others.
    """

    smallest_slope: float
    normal_length_m: float
    outlier_density: float


def log_likelihood_from_grid(
    rows: Array, contacts: ContactSet, grid: FieldGrid, constants: LikelihoodConstants
) -> Array:
    """``log P(z | x)`` for planar poses of shape (n, 3) and contacts in the world; shape (n,).

    Raises:
        ShapeError: the grid was tabulated without gradients or variances.
    """
    counts = np.array(grid.values_m.shape, dtype=np.int64)
    result = np.empty(len(rows))
    _weigh(
        np.ascontiguousarray(rows, dtype=float),
        np.ascontiguousarray(contacts.points_m),
        np.ascontiguousarray(contacts.normals),
        contacts.point_sigma_m**2,
        contacts.normal_sigma_rad**2,
        grid.interleave(),
        counts,
        np.ascontiguousarray(grid.lower_m),
        float(grid.spacing_m),
        float(constants.smallest_slope),
        float(constants.normal_length_m),
        float(constants.outlier_density),
        result,
    )
    return result


@compile_when_called
def _weigh(
    rows: Array,
    points: Array,
    normals: Array,
    point_variance: Array,
    normal_variance: Array,
    nodes: Array,
    counts: NDArray[np.int64],
    lower: Array,
    spacing: float,
    smallest_slope: float,
    normal_length: float,
    outlier_density: float,
    result: Array,
) -> None:
    dimension = points.shape[1]
    point, normal, field = np.empty(dimension), np.empty(dimension), np.empty(dimension + 2)
    share, cell = np.empty(dimension), np.empty(dimension, dtype=np.int64)
    for particle in range(len(rows)):
        x, y = rows[particle, 0], rows[particle, 1]
        cosine, sine = math.cos(rows[particle, 2]), math.sin(rows[particle, 2])
        log_sum, density = 0.0, 1.0
        for contact in range(len(points)):
            along_x, along_y = points[contact, 0] - x, points[contact, 1] - y
            point[0], point[1] = cosine * along_x + sine * along_y, cosine * along_y - sine * along_x
            normal[0] = cosine * normals[contact, 0] + sine * normals[contact, 1]
            normal[1] = cosine * normals[contact, 1] - sine * normals[contact, 0]
            if dimension == 3:
                point[2], normal[2] = points[contact, 2], normals[contact, 2]
            _look_up(point, nodes, counts, lower, spacing, share, cell, field)
            density *= outlier_density + _density(
                field, normal, point_variance[contact], normal_variance[contact], smallest_slope, normal_length
            )
            if not 1e-100 < density < 1e100:
                log_sum, density = log_sum + math.log(density), 1.0
        result[particle] = log_sum + math.log(density)


@compile_when_called
def _look_up(
    point: Array,
    nodes: Array,
    counts: NDArray[np.int64],
    lower: Array,
    spacing: float,
    share: Array,
    cell: NDArray[np.int64],
    field: Array,
) -> None:
    """Write the field at a point, linear between the nodes; beyond them the distance to the grid is added."""
    dimension, columns = len(point), len(field)
    beyond, first = 0.0, 0
    for axis in range(dimension):
        place = (point[axis] - lower[axis]) / spacing
        inside = min(place, counts[axis] - 1.0) if place > 0.0 else 0.0  # never an index from NaN
        cell[axis] = min(int(inside), counts[axis] - 2)
        share[axis] = inside - cell[axis]
        beyond += (place - inside) ** 2
        first = first * counts[axis] + cell[axis]
    field[:] = 0.0
    for corner in range(1 << dimension):
        weight, step = 1.0, 0
        for axis in range(dimension):
            side = (corner >> axis) & 1
            weight *= share[axis] if side else 1.0 - share[axis]
            step = step * counts[axis] + side
        for column in range(columns):
            field[column] += weight * nodes[first + step, column]
    field[0] += spacing * math.sqrt(beyond)


@compile_when_called
def _density(
    field: Array,
    normal: Array,
    point_variance: float,
    normal_variance: float,
    smallest_slope: float,
    normal_length: float,
) -> float:
    """Density of one contact's distance and angle to the surface."""
    dimension = len(normal)
    squared, along = 0.0, 0.0
    for axis in range(dimension):
        squared += field[1 + axis] ** 2
        along += field[1 + axis] * normal[axis]
    slope = math.sqrt(squared)
    scale = max(slope, smallest_slope)
    variance = field[dimension + 1]
    distance_variance = point_variance + variance / (scale * scale)
    angle_variance = normal_variance + min(variance / normal_length**2, 1.0)
    misfit = 0.5 * (field[0] / scale) ** 2 / distance_variance + (1 - along / max(slope, 1e-9)) / angle_variance
    spread = distance_variance * angle_variance * (angle_variance if dimension == 3 else 1.0)
    return math.exp(-misfit) / math.sqrt(spread)
