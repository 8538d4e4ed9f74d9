"""A box of 10 x 6 cm as a session knows it after contacts all around: as a contour, and as a solid."""

from __future__ import annotations

import numpy as np

from tactile_lab.autonomy.variance_planner import ExplorationSettings, KnownShape, known_shape
from tactile_lab.slam.shape.fields.gpis import Gpis

HEIGHT_m = 0.022


def sides(half_x_m: float = 0.05, half_y_m: float = 0.03) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals on the four sides of a box, in the plane."""
    along, across = np.linspace(-0.9, 0.9, 7) * half_x_m, np.linspace(-0.9, 0.9, 5) * half_y_m
    rows = [
        (np.column_stack([along, np.full(7, half_y_m)]), (0.0, 1.0)),
        (np.column_stack([along, np.full(7, -half_y_m)]), (0.0, -1.0)),
        (np.column_stack([np.full(5, half_x_m), across]), (1.0, 0.0)),
        (np.column_stack([np.full(5, -half_x_m), across]), (-1.0, 0.0)),
    ]
    return np.vstack([row[0] for row in rows]), np.vstack([np.tile(row[1], (len(row[0]), 1)) for row in rows])


def flat_box(half_x_m: float = 0.05, half_y_m: float = 0.03) -> KnownShape:
    return known_shape(Gpis.fit(*sides(half_x_m, half_y_m), 0.001, 0.05), 2, HEIGHT_m, ExplorationSettings())


def solid_contacts(
    height_m: float = 0.04, half_x_m: float = 0.05, half_y_m: float = 0.03
) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals on its sides at two heights and on its top, frame on the table."""
    points, normals = sides(half_x_m, half_y_m)
    layers = [np.column_stack([points, np.full(len(points), part * height_m)]) for part in (0.25, 0.75)]
    flat = np.column_stack([normals, np.zeros(len(normals))])
    grid = np.stack(np.meshgrid([-0.03, 0.0, 0.03], [-0.015, 0.015]), axis=-1).reshape(-1, 2)
    top = np.column_stack([grid, np.full(len(grid), height_m)])
    return np.vstack([*layers, top]), np.vstack([flat, flat, np.tile([0.0, 0.0, 1.0], (len(top), 1))])


def solid_box(height_m: float = 0.04, half_x_m: float = 0.05, half_y_m: float = 0.03) -> KnownShape:
    """The solid shape of the box from these contacts."""
    field = Gpis.fit(*solid_contacts(height_m, half_x_m, half_y_m), 0.001, 0.05)
    return known_shape(field, 3, 0.0, ExplorationSettings())


FLAT_BOX, SOLID_BOX = flat_box(), solid_box()
