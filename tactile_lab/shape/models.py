"""Shape models by name: the best of ours, each alone, and those of section 2.1 to compare with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Literal, TypeAlias, get_args

import numpy as np

from tactile_lab.errors import ConfigurationError, ShapeError
from tactile_lab.geometry.contacts import Array
from tactile_lab.shape.choice import GpisShape, best_shape, polygon_of
from tactile_lab.shape.edge_features import EdgeFeatureField, EdgeFeatureShape
from tactile_lab.shape.gpis import Gpis
from tactile_lab.shape.model import FittedShape
from tactile_lab.shape.nagata import NagataShape
from tactile_lab.shape.occupancy import OccupancyShape
from tactile_lab.shape.point_cloud import PointCloudShape
from tactile_lab.shape.polygon_segmentation import PlanarContacts, order_along
from tactile_lab.shape.polyhedron import Polyhedron
from tactile_lab.shape.superquadric import fit_superquadric
from tactile_lab.shape.superquadric_shape import SuperquadricShape
from tactile_lab.shape.surface import extract_contour

ShapeName: TypeAlias = Literal[
    "auto", "gpis", "facets", "superquadric", "nagata", "occupancy", "point-cloud", "edge-features"
]
Fit: TypeAlias = Callable[[Gpis, Array | None, float | None], FittedShape]
"""Makes a shape from a field's contacts, places known to be outside, and the height of the table."""

_GRADIENT_SIGMA = 0.1
"""Of normals where the field has none, as with the thesis's off-surface points."""


def fit_shape(name: str, gpis: Gpis, free_points_m: Array | None = None, floor_m: float | None = None) -> FittedShape:
    """The shape model of a name, made from the contacts of a field.

    Args:
        name: one of :data:`ShapeName`; "auto" is chosen by evidence.
        gpis: the field, with its contacts and their standard deviations.
        free_points_m: places known to be outside, shape (q, d).
        floor_m: height of the table that the object stands on, for contacts in space.

    Raises:
        ConfigurationError: no such model.
        ShapeError: the contacts do not make such a shape.
    """
    models = shape_models()
    if name not in models:
        raise ConfigurationError(f'no shape model is called "{name}"', hint=f"One of {', '.join(models)}")
    return models[name](gpis, free_points_m, floor_m)


def shape_models() -> Mapping[str, Fit]:
    """All models by name."""
    fits: tuple[Fit, ...] = (best_shape, _gpis, _facets, _superquadric, _nagata, _occupancy, _point_cloud, _edges)
    return MappingProxyType(dict(zip(get_args(ShapeName), fits, strict=True)))


def _gpis(gpis: Gpis, _: Array | None, __: float | None) -> FittedShape:
    return GpisShape(gpis)


def _facets(gpis: Gpis, free_points_m: Array | None, _: float | None) -> FittedShape:
    if gpis.contacts_m.shape[1] == 3:
        return Polyhedron.fit(gpis, free_points_m)
    return polygon_of(gpis, extract_contour(gpis))


def _superquadric(gpis: Gpis, _: Array | None, __: float | None) -> FittedShape:
    return SuperquadricShape(fit_superquadric(gpis.contacts_m, gpis.normals, _point_sigma(gpis), _normal_sigma(gpis)))


def _nagata(gpis: Gpis, _: Array | None, __: float | None) -> FittedShape:
    order = None
    if gpis.contacts_m.shape[1] == 2:
        contacts = PlanarContacts.of(gpis.contacts_m, gpis.normals, _point_sigma(gpis), _normal_sigma(gpis))
        try:
            order = order_along(contacts, extract_contour(gpis).points_m)
        except ShapeError:  # no outline to go along: the order by angle is left
            order = None
    return NagataShape.of(gpis.contacts_m, gpis.normals, _point_sigma(gpis), order)


def _occupancy(gpis: Gpis, free_points_m: Array | None, _: float | None) -> FittedShape:
    return OccupancyShape.of(gpis.contacts_m, gpis.normals, _point_sigma(gpis), free_points_m)


def _point_cloud(gpis: Gpis, _: Array | None, __: float | None) -> FittedShape:
    return PointCloudShape.of(gpis.contacts_m, gpis.normals, _point_sigma(gpis))


def _edges(gpis: Gpis, _: Array | None, __: float | None) -> FittedShape:
    return EdgeFeatureShape(EdgeFeatureField(gpis.contacts_m, gpis.normals), float(_point_sigma(gpis).mean()))


def _point_sigma(gpis: Gpis) -> Array:
    return gpis.observations.value_sigma_m[: len(gpis.contacts_m)]


def _normal_sigma(gpis: Gpis) -> Array:
    seen = gpis.observations.gradient_sigma
    return seen if len(seen) else np.full(len(gpis.contacts_m), _GRADIENT_SIGMA)
