"""A smooth field as a shape."""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh, extract_contour, extract_mesh, slope_of


class GpisShape:
    """A field; implements FittedShape.

    Attributes:
        name: "gpis".
        gpis: the field.
    """

    name = "gpis"

    def __init__(self, gpis: Gpis) -> None:
        self.gpis = gpis

    @property
    def log_evidence(self) -> float | None:
        """The log marginal likelihood; None with off-surface points, which other models do not explain."""
        return self.gpis.log_marginal_likelihood() if self.gpis.settings.observations == "normals" else None

    def contour(self, resolution_m: float = 0.001) -> Contour:
        return extract_contour(self.gpis, resolution_m=resolution_m)

    def covariance_m2(self, places_m: Array) -> Array:
        """Covariance of displacements along the normals at places on the outline, shapes (q, 2) and (q, q)."""
        slopes = self.gpis.sigma_inflation / slope_of(self.gpis.gradient(places_m))
        return np.asarray(self.gpis.joint_covariance(places_m) * slopes[:, None] * slopes)

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        return extract_mesh(self.gpis, resolution_m=resolution_m, floor_m=floor_m)
