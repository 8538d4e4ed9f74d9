"""A fitted superquadric as a shape model."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.core.contacts import Array
from tactile_lab.slam.shape.baselines.implicit import contour_of, mesh_of
from tactile_lab.slam.shape.baselines.superquadric import SuperquadricFit
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh


@dataclass(frozen=True)
class SuperquadricShape:
    """A :class:`FittedShape`.

    Attributes:
        fit: the superquadric and its covariance.
        name: "superquadric".
    """

    fit: SuperquadricFit
    name: str = "superquadric"

    @property
    def log_evidence(self) -> float:
        """The log evidence by the Bayesian information criterion."""
        return self.fit.log_evidence

    def contour(self, resolution_m: float = 0.001) -> Contour:
        return contour_of(self.fit.superquadric.value, *self._box(), resolution_m, self.fit.sigma)

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        return mesh_of(self.fit.superquadric.value, *self._box(), resolution_m, self.fit.sigma, floor_m)

    def _box(self) -> tuple[Array, Array]:
        """Corners of its bounding box along the frame's axes."""
        figure = self.fit.superquadric
        reach = figure.semi_axes_m @ abs(figure.axes)
        return figure.centre_m - reach, figure.centre_m + reach
