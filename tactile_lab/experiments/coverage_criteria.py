"""The two definitions of an explored contour that the exploration experiments report.

A point of the true contour is explored by definition A if the estimated contour passes within 3 mm of it, with a
variance below that of a field with one contact at a distance of 3 mm (5 mm if the object moves) along the surface. By
definition B it is explored if the estimated contour passes within 3 mm, and a contact lies within 4.5 mm. The field is
always the same: Matern kernel, 14 mm amplitude, 40 mm length, normals observed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.experiments.data.sensing import NORMAL_SIGMA_rad, POINT_SIGMA_m
from tactile_lab.slam.exploration.policy import Surface
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.shape.surfaces.sampling import sample_polygon
from tactile_lab.slam.shape.surfaces.surface import extract_contour

FIELD = GpisSettings(amplitude_m=0.0141, length_m=0.040)
NEAR_m = 0.003
CONTACT_m = 0.0045
GOAL = 0.9
_CONTOUR_GRID_m = 0.0025
_STEP_m = 0.001

Definition: TypeAlias = Literal["A3", "A5", "B"]


@dataclass(frozen=True)
class ExploredMap:
    """The field through a set of contacts and its outline.

    Attributes:
        field: in the contacts' frame.
        surface: the outline; None if the contacts enclose nothing.
        dense_m: points on the outline every millimetre, shape (n, 2); empty if there is none.
    """

    field: Gpis
    surface: Surface | None
    dense_m: Array

    @classmethod
    def of(cls, points_m: Array, normals: Array) -> ExploredMap:
        """The map of contacts of shape (n, 2). Raises ShapeError for contacts that no field fits."""
        field = Gpis.fit(points_m, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad, FIELD)
        try:
            contour = extract_contour(field, resolution_m=_CONTOUR_GRID_m)
        except ShapeError:
            return cls(field, None, np.empty((0, 2)))
        return cls(field, Surface.of(contour), sample_polygon(contour.points_m, _STEP_m))

    def explored_points(self, definition: Definition, true_points_m: Array) -> NDArray[np.bool_]:
        """Which points of the true contour, in the contacts' frame, are explored; shape (n,).

        Args:
            definition: the definition to use.
            true_points_m: shape (n, 2).
        """
        known = self.dense_m
        if definition != "B" and len(known):
            known = known[self.field.variance(known) < isolated_variance(float(definition[1:]) / 1000)]
        if len(known) == 0:
            return np.zeros(len(true_points_m), dtype=bool)
        near = cKDTree(known).query(true_points_m)[0] < NEAR_m
        if definition == "B":
            near &= cKDTree(self.field.contacts_m).query(true_points_m)[0] < CONTACT_m
        return np.asarray(near)


@lru_cache
def isolated_variance(beside_m: float) -> float:
    """The field's variance at a distance along the surface from a single contact, square metres."""
    alone = Gpis.fit(np.zeros((1, 2)), np.array([[0.0, 1.0]]), POINT_SIGMA_m, NORMAL_SIGMA_rad, FIELD)
    return float(alone.variance(np.array([[beside_m, 0.0]]))[0])
