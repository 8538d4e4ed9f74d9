"""Shape models by name: the choice by evidence, each single model, and those of section 2.1 for comparison."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, TypeAlias

import numpy as np
from pydantic import AfterValidator

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from drivers.core.registry import Registry
from tactile_lab.slam.shape.baselines.edge_features import EdgeFeatureField, EdgeFeatureShape
from tactile_lab.slam.shape.baselines.nagata import NagataShape
from tactile_lab.slam.shape.baselines.occupancy import OccupancyShape
from tactile_lab.slam.shape.baselines.point_cloud import PointCloudShape
from tactile_lab.slam.shape.baselines.superquadric import fit_superquadric
from tactile_lab.slam.shape.baselines.superquadric_shape import SuperquadricShape
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.gpis_shape import GpisShape
from tactile_lab.slam.shape.model import FittedShape
from tactile_lab.slam.shape.planar.segmentation import PlanarContacts, order_along
from tactile_lab.slam.shape.selection.planar_choice import best_shape, polygon_of
from tactile_lab.slam.shape.solids.polyhedron import Polyhedron
from tactile_lab.slam.shape.surfaces.surface import extract_contour

Fit: TypeAlias = Callable[[Gpis, Array | None, float | None], FittedShape]
"""Makes a shape from a field with its contacts, places known to be outside, and the height of the table."""

_GRADIENT_SIGMA = 0.1
"""Standard deviation of normals if the field has none, as with the thesis's off-surface points."""


def fit_shape(name: str, gpis: Gpis, free_points_m: Array | None = None, floor_m: float | None = None) -> FittedShape:
    """Fit the shape model of a given name to the contacts of a field.

    Args:
        name: one of :data:`SHAPE_MODELS`; "auto" chooses by evidence.
        gpis: the field, with its contacts and their standard deviations.
        free_points_m: places known to be outside, shape (q, d).
        floor_m: height of the table that the object stands on, for contacts in space.

    Raises:
        ConfigurationError: there is no such model.
        ShapeError: the contacts do not define such a shape.
    """
    return SHAPE_MODELS[name](gpis, free_points_m, floor_m)


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
        except ShapeError:  # without an outline, contacts are ordered by angle
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


SHAPE_MODELS: Registry[Fit] = Registry("shape model", group="shape_models")
"""Constructors of the models, by name. See ``docs/extending.md`` for adding one."""

SHAPE_MODELS.register("auto", best_shape)
SHAPE_MODELS.register("gpis", _gpis)
SHAPE_MODELS.register("facets", _facets)
SHAPE_MODELS.register("superquadric", _superquadric)
SHAPE_MODELS.register("nagata", _nagata)
SHAPE_MODELS.register("occupancy", _occupancy)
SHAPE_MODELS.register("point-cloud", _point_cloud)
SHAPE_MODELS.register("edge-features", _edges)

ShapeName: TypeAlias = Annotated[str, AfterValidator(SHAPE_MODELS.known)]
"""The name of a registered model, for settings."""
