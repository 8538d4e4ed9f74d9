"""How well shapes with edges explain the contacts of a map at its poses: outlines in the plane, solids in space."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.planar.polygon import Polygon
from tactile_lab.slam.shape.selection.contradictions import stray_cost
from tactile_lab.slam.shape.selection.planar_choice import (
    SharpOutline,
    best_shape,
    free_evidence,
    polygon_of,
    sharp_outlines,
)
from tactile_lab.slam.shape.solids.polyhedron import Polyhedron, contacts_of
from tactile_lab.slam.shape.solids.prism import Prism
from tactile_lab.slam.shape.surfaces.sampling import distances_to_mesh, distances_to_polygon
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh, extract_contour
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.free_space import free_space_costs
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR

_ORDERING_RESOLUTION_m = 0.002
"""Of outlines that only order contacts and are compared with free places."""

_COARSE_m = 0.006
"""Of solids that contacts are measured against."""


def explain(contact_map: ContactMap, fitted: Gpis) -> tuple[float, float]:
    """Log evidence of the best sharp shape, and the cost of the free places it fills. Raises ShapeError."""
    free = contact_map.free_points_m
    if contact_map.dimension == 2:
        sharp = sharp_outlines(fitted, extract_contour(fitted, resolution_m=_ORDERING_RESOLUTION_m))
        explained = [_explained_by(outline, fitted, free) for outline in sharp]
        return max(explained, key=lambda one: one[0] - one[1])
    return best_solid(contact_map, fitted)[0], intrusion_cost(contact_map)


def _explained_by(outline: SharpOutline, fitted: Gpis, free_m: Array) -> tuple[float, float]:
    """As :func:`explain`, for one outline."""
    strays = stray_cost(*away_from_m(outline, fitted))
    intrusion = -free_evidence(outline.contour(_ORDERING_RESOLUTION_m), free_m, fitted)
    return outline.log_evidence - strays, intrusion


def polygon(fitted: Gpis) -> Polygon:
    """The outline with flat faces. Raises ShapeError if there is none."""
    return polygon_of(fitted, extract_contour(fitted, resolution_m=_ORDERING_RESOLUTION_m))


def away_from_m(outline: SharpOutline, fitted: Gpis) -> tuple[Array, Array]:
    """Distances of all contacts from an outline, and the inverse variances of their noise, each of shape (n,)."""
    return distances_to_polygon(fitted.contacts_m, outline.outline_m), fitted.observations.value_sigma_m**-2.0


def intrusion_cost(contact_map: ContactMap) -> float:
    """The cost of the free places in space that the field fills."""
    return float(free_space_costs(contact_map.fit(), contact_map.free_points_m[None])[0])


def best_solid(contact_map: ContactMap, fitted: Gpis) -> tuple[float, SurfaceMesh]:
    """Log evidence and surface of the likeliest solid with flat faces or upright walls. Raises ShapeError."""
    on_table, free = contact_map.space is PLANAR, contact_map.free_points_m
    makers: list[Callable[[], Polyhedron | Prism]] = []
    without = fitted.settings.without
    if "polyhedron" not in without:
        makers.append(lambda: Polyhedron.fit(fitted, free, upright=on_table))
    if on_table and "prism" not in without:
        makers.append(lambda: Prism.fit(fitted, best_shape))
    solids = [solid for solid in map(_try_make, makers) if solid is not None]
    best: tuple[float, SurfaceMesh] | None = None
    for solid in sorted(solids, key=lambda one: -one.log_evidence):  # surfaces are dear: the likelier one's comes first
        best = _on_surface(solid, fitted, best) or best
    if best is None:
        raise ShapeError("the contacts enclose no solid with flat faces or upright walls")
    return best


def _try_make(maker: Callable[[], Polyhedron | Prism]) -> Polyhedron | Prism | None:
    try:
        return maker()
    except ShapeError:  # too few contacts on walls, or on too many planes
        return None


def _on_surface(
    solid: Polyhedron | Prism, fitted: Gpis, known: tuple[float, SurfaceMesh] | None
) -> tuple[float, SurfaceMesh] | None:
    """A solid's log evidence, less for contacts that its surface leaves out, and its surface; None if not likelier."""
    least = -np.inf if known is None else known[0]
    if solid.log_evidence <= least:
        return None
    try:
        mesh = solid.mesh(_COARSE_m)
    except ShapeError:  # its faces enclose nothing
        return None
    evidence = solid.log_evidence - stray_cost(
        distances_to_mesh(fitted.contacts_m, mesh), contacts_of(fitted).point_weights
    )
    return (evidence, mesh) if evidence > least else None
