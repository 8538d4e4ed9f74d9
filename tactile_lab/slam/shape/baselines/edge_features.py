"""Local surface features (2.21-2.23): a field that keeps the edges and corners that smooth kernels round off.

The field blends the contacts' tangent planes. The blend favours the innermost or outermost plane, depending on whether
the contacts around are concave or convex, so that planes meet in an edge.

The thesis prints (2.21) with weights omega and (2.23) with an angular kernel without defining either (section 2.2.3);
here the weights make the blend an average, and the angular kernel is the mean convexity of those neighbours that lie in
the direction of the query point, as seen from the contact in its tangent plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from drivers.core.contacts import Array
from tactile_lab.slam.shape.baselines.implicit import contour_of, mesh_of
from tactile_lab.slam.shape.baselines.scattered import distance_sigma
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

_LENGTH_BOUNDS_m = (0.008, 0.040)
_NEIGHBOUR, _REACH = 3, 1.5
"""Length of the kernel relative to the median distance of the contacts' third neighbours."""
_ANGULAR_WIDTH = 0.5
"""Width of the angular kernel, in units of one minus the cosine."""
_FLAT_NORMALS = 0.35
"""Neighbours whose normals differ by less (20 degrees) count as the same face, neither convex nor concave."""
_MOST_CONVEX = 0.97
"""Below one, so that points behind all planes still have a value."""
_LEAST_WEIGHT = 1e-3
"""Neighbours with a smaller total weight are too far away to distinguish convex from concave."""
_NEIGHBOURS = 16
_SUPPORT_SLACK_m, _SUPPORT_TILT = 0.002, 0.1
"""Assumed errors of a contact's plane (m) and of its direction (rad)."""
_MARGIN_m = 0.012
_PAIRS_AT_ONCE = 1 << 21


class EdgeFeatureField:
    """The function f of (2.21), metres, positive outside.

    Attributes:
        points_m: contacts, shape (n, d).
        normals: shape (n, d).
        length_m: length of the kernel.
    """

    def __init__(self, points_m: Array, normals: Array, length_m: float | None = None) -> None:
        self.points_m, self.normals = points_m, normals
        self.length_m = length_m or _typical_distance(points_m)
        self._neighbours, self._convexity, self._near = self._bent_neighbours()

    def value(self, places_m: Array) -> Array:
        """f at points of shape (q, d); shape (q,)."""
        size = max(1, _PAIRS_AT_ONCE // (len(self.points_m) * _NEIGHBOURS))
        blocks = [self._value(places_m[first : first + size]) for first in range(0, len(places_m), size)]
        return np.concatenate(blocks) if blocks else np.empty(0)

    def _value(self, places_m: Array) -> Array:
        offset = places_m[:, None] - self.points_m[None]
        height = np.einsum("qnd,nd->qn", offset, self.normals)  # y_i, (2.22)
        squared = np.sum(offset**2, axis=2)
        kernel = np.exp(-(squared - squared.min(axis=1, keepdims=True)) / self.length_m**2)
        lean = 1 + np.sign(height) * self._lean(offset, height)  # beta_i, (2.23)
        weight = kernel * lean
        return np.asarray(np.sum(weight * height, axis=1) / np.sum(weight, axis=1))

    def _lean(self, offset: Array, height: Array) -> Array:
        """``beta*(phi)``: convexity around each contact in the direction of each query point, shape (q, n)."""
        sideways = _unit(offset - height[..., None] * self.normals)
        cosine = np.einsum("qid,ijd->qij", sideways, self._neighbours)
        weight = self._near * np.exp((cosine - 1) / _ANGULAR_WIDTH)
        found = np.sum(weight * self._convexity, axis=2) / (np.sum(weight, axis=2) + _LEAST_WEIGHT)
        return np.asarray(np.clip(found, -_MOST_CONVEX, _MOST_CONVEX))

    def _bent_neighbours(self) -> tuple[Array, Array, Array]:
        """For each contact, its neighbours on other faces: directions in its tangent plane (n, k, d), convexity from -1
        to 1, and weight by distance (n, k).
        """
        between = self.points_m[None] - self.points_m[:, None]
        turned = self.normals[None] - self.normals[:, None]
        product, size = np.sum(between * turned, axis=2), np.linalg.norm(turned, axis=2)
        share = np.abs(product) / np.maximum(size * np.linalg.norm(between, axis=2), 1e-12)
        convexity = np.where(size > _FLAT_NORMALS, np.sign(product) * np.sqrt(share), 0.0)
        near = np.exp(-np.sum(between**2, axis=2) / (2 * self.length_m) ** 2) * (convexity != 0)
        best = np.argsort(-near, axis=1, kind="stable")[:, :_NEIGHBOURS]
        along = np.einsum("ijd,id->ij", between, self.normals)
        directions = _unit(between - along[..., None] * self.normals[:, None])
        chosen = np.take_along_axis(directions, best[..., None], axis=1)
        return chosen, np.take_along_axis(convexity, best, axis=1), np.take_along_axis(near, best, axis=1)


@dataclass(frozen=True)
class EdgeFeatureShape:
    """The zero level of (2.21) as a :class:`FittedShape`, without evidence.

    Far from all contacts the function is that of the nearest planes, which extend to infinity. So points clearly beyond
    a plane that has all contacts behind it are excluded from the shape.

    Attributes:
        field: the function.
        point_sigma_m: mean standard deviation of the contacts.
    """

    field: EdgeFeatureField
    point_sigma_m: float
    name: str = "edge-features"
    log_evidence: None = None

    def contour(self, resolution_m: float = 0.001) -> Contour:
        return contour_of(self._clamp, *self._box(), resolution_m, self._sigma)

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        return mesh_of(self._clamp, *self._box(), resolution_m, self._sigma, floor_m)

    def _clamp(self, places_m: Array) -> Array:
        contacts, normals = self.field.points_m, self.field.normals
        supporting = _beyond(contacts, contacts, normals).max(axis=0) <= 0
        if not supporting.any():
            return self.field.value(places_m)
        bound = _beyond(places_m, contacts[supporting], normals[supporting]).max(axis=1)
        return np.asarray(np.maximum(self.field.value(places_m), bound))

    def _box(self) -> tuple[Array, Array]:
        return self.field.points_m.min(axis=0) - _MARGIN_m, self.field.points_m.max(axis=0) + _MARGIN_m

    def _sigma(self, places_m: Array) -> Array:
        return distance_sigma(places_m, self.field.points_m, self.point_sigma_m)


def _beyond(places_m: Array, points_m: Array, normals: Array) -> Array:
    """Distance of points beyond the contacts' planes, less the uncertainty of the planes, shape (q, n)."""
    offset = places_m[:, None] - points_m[None]
    height = np.einsum("qnd,nd->qn", offset, normals)
    return np.asarray(height - _SUPPORT_TILT * np.linalg.norm(offset, axis=2) - _SUPPORT_SLACK_m)


def _typical_distance(points_m: Array) -> float:
    count = min(_NEIGHBOUR + 1, len(points_m))
    away, _ = cKDTree(points_m).query(points_m, k=count)
    return float(np.clip(_REACH * np.median(np.reshape(away, (len(points_m), -1))[:, -1]), *_LENGTH_BOUNDS_m))


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12))
