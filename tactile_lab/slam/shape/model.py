"""The interface of shape models."""

from __future__ import annotations

from typing import Protocol

from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh


class FittedShape(Protocol):
    """A shape made from contacts, in the frame of the contacts.

    Attributes:
        name: name of the model in settings.
        log_evidence: logarithm of the probability of the contacts (values and normals) under the model, comparable
            between models; None for models without a likelihood.
    """

    @property
    def name(self) -> str: ...

    @property
    def log_evidence(self) -> float | None: ...

    def contour(self, resolution_m: float = 0.001) -> Contour:
        """The outline, for contacts in the plane.

        Raises:
            ShapeError: the contacts are in space, or enclose nothing.
        """

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        """The surface, for contacts in space; it ends in a flat foot at the table if its height is given.

        Raises:
            ShapeError: the contacts are in the plane, or enclose nothing.
        """
