"""A solid with flat faces from contacts: planes, the cells into which they divide space, and the cells that are
material.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.solids.cells import arrange
from tactile_lab.slam.shape.solids.extent import Cap, open_sides
from tactile_lab.slam.shape.solids.labels import label_cells
from tactile_lab.slam.shape.solids.mesh import FacetMesh, area_weighted_normals, borders, boundary, refine
from tactile_lab.slam.shape.solids.planes import Planes, WeightedContacts, divide, weighted_contacts
from tactile_lab.slam.shape.solids.regularity import RegularPlanes, regularise
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

LARGEST_PLANE_COUNT = 24
"""More planes make thousands of cells; a shape that needs more is a curved one."""

OFFSET_RANGE_m = 0.1
"""Prior range of a plane's offset: about the size of objects that a hand explores."""

_DEFAULT_NORMAL_SIGMA_rad = 0.1
_MARGIN_m = 0.030
_SIMILAR_ANGLE_rad, _SIMILAR_OFFSET_m = np.deg2rad(30.0), 0.012
_LEAST_SUPPORT, _LARGEST_SINGLE_SHARE = 2, 0.04
_VERTEX_SPACING = 2.0
_FOOT_SIGMA_m = 1e-4
_SUPPORT_m, _UNSUPPORTED_SLOPE = 0.020, 0.05
"""A face is trusted up to this distance from its contacts; beyond, its sigma grows by this share of the distance."""


class Polyhedron:
    """Planes through contacts and the body that they enclose; implements FittedShape. Made by :meth:`fit`.

    Attributes:
        name: "polyhedron".
        planes: all planes, made as regular as the contacts allow.
        log_evidence: Gaussian log likelihood of points and normals, minus the penalty of the planes
            (:func:`_log_evidence`).
    """

    name = "polyhedron"

    def __init__(self, gpis: Gpis, contacts: WeightedContacts, regular: RegularPlanes, free_points_m: Array) -> None:
        self._gpis, self._contacts, self._regular, self._free_points_m = gpis, contacts, regular, free_points_m
        self.log_evidence = _log_evidence(contacts, regular)
        self._body = lru_cache(maxsize=2)(self._build)

    @classmethod
    def fit(cls, gpis: Gpis, free_points_m: Array | None = None, *, upright: bool = True) -> Self:
        """Fit planes to the contacts of a field, with the field's sigmas.

        Args:
            gpis: a field fitted in space; it also bounds the solid on untouched sides.
            free_points_m: places that a finger went through, shape (k, 3), or None.
            upright: whether the third axis is vertical, so that horizontal and vertical faces are likely.

        Raises:
            ShapeError: the contacts are in the plane, or on too many planes.
        """
        contacts = contacts_of(gpis)
        planes = divide(contacts)
        if planes.count > LARGEST_PLANE_COUNT:
            raise ShapeError(f"{planes.count} planes are too many for a solid with flat faces")
        regular = regularise(contacts, planes, upright=upright, regular="right angles" not in gpis.settings.without)
        free = np.empty((0, 3)) if free_points_m is None else np.asarray(free_points_m, dtype=float).reshape(-1, 3)
        return cls(gpis, contacts, regular, free)

    @property
    def planes(self) -> Planes:
        return self._regular.planes

    def ends(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Where the planes end: the plane of each contact, shape (n,), and :func:`borders` between planes.

        The plane is -1 if it bounds nothing, as that of an outlier.

        Raises:
            ShapeError: the planes enclose nothing.
        """
        body, kept, _ = self._body(None)
        found = borders(body)
        touched = (found[:, :2] >= 0) & (found[:, :2] < kept.planes.count)
        return kept.planes.labels, found[touched.all(axis=1)]

    def contour(self, resolution_m: float = 0.001) -> Contour:
        """Raises ShapeError: a solid has no outline."""
        raise ShapeError("contacts in space have a surface, not an outline", hint="Ask for the mesh")

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        """The surface with sharp edges, watertight, its vertices at most twice ``resolution_m`` apart.

        Raises:
            ShapeError: the planes enclose nothing.
        """
        coarse, kept, caps = self._body(floor_m)
        fine = refine(coarse, _VERTEX_SPACING * resolution_m)
        sigma_m = self._sigma(fine, kept, caps)
        return SurfaceMesh(fine.vertices_m, fine.triangles, sigma_m, area_weighted_normals(fine), is_closed=True)

    def moves_m(self, places_m: Array, normals: Array) -> Array:
        """How one standard deviation of each error of the planes moves the surface along its normals, shape (q, m)."""
        return self._scatter * self._regular.moves_m(places_m, normals)

    def _build(self, floor_m: float | None) -> tuple[FacetMesh, RegularPlanes, tuple[Cap, ...]]:
        """The coarse body, its planes, and the caps that come after them."""
        kept = _drop_lone_planes(self._regular)
        if kept.planes.count == 0:
            raise ShapeError("no plane is touched twice: these enclose nothing")
        caps = open_sides(self._gpis, kept.planes, floor_m)
        normals = np.vstack([kept.planes.normals, *(cap.normal[None] for cap in caps)])
        offsets = np.append(kept.planes.offsets_m, [cap.offset_m for cap in caps])
        lower, upper = self._box(caps, floor_m)
        arrangement = arrange(normals, offsets, lower, upper)
        material = label_cells(
            arrangement, kept.planes, self._contacts.points_m, self._gpis, self._free_points_m, floor_m
        )
        return boundary(arrangement, material), kept, caps

    def _box(self, caps: tuple[Cap, ...], floor_m: float | None) -> tuple[Array, Array]:
        contacts = self._contacts.points_m
        reach = np.vstack([contacts, *(cap.foot_m[None] for cap in caps)])
        lower, upper = reach.min(axis=0) - _MARGIN_m, reach.max(axis=0) + _MARGIN_m
        if floor_m is not None:
            if contacts[:, 2].max() <= floor_m:
                raise ShapeError("all contacts lie below the table", hint="Check the units and the contacts' heights")
            lower[2] = floor_m
        return lower, upper

    def _sigma(self, mesh: FacetMesh, regular: RegularPlanes, caps: tuple[Cap, ...]) -> Array:
        """The largest sigma of the planes that meet at each vertex."""
        sigma = np.full(len(mesh.vertices_m), _FOOT_SIGMA_m)
        for plane in np.unique(mesh.planes[mesh.planes >= 0]):
            touched = np.unique(mesh.triangles[mesh.planes == plane])
            here = self._plane_sigma(int(plane), mesh.vertices_m[touched], regular, caps)
            sigma[touched] = np.maximum(sigma[touched], here)
        return sigma

    def _plane_sigma(self, plane: int, points_m: Array, regular: RegularPlanes, caps: tuple[Cap, ...]) -> Array:
        """Sigma of a plane at points on it: its own, increased if contacts scatter, and far from its contacts."""
        if plane >= regular.planes.count:
            return np.full(len(points_m), caps[plane - regular.planes.count].sigma_m)
        contacts = self._contacts.points_m[regular.planes.labels == plane]
        away, _ = cKDTree(contacts).query(points_m)
        guessed = _UNSUPPORTED_SLOPE * np.maximum(away - _SUPPORT_m, 0.0)
        return np.hypot(self._scatter * regular.sigma_m(plane, points_m), guessed)

    @property
    def _scatter(self) -> float:
        """Ratio of the contacts' scatter about their planes to their sigmas, at least 1."""
        return max(1.0, float(np.sqrt(self.planes.chi_square / (3 * len(self._contacts)))))


def contacts_of(gpis: Gpis) -> WeightedContacts:
    """Contacts of a field with its assumed noise, including its noise scale.

    Raises:
        ShapeError: the contacts are in the plane.
    """
    if gpis.contacts_m.shape[1] != 3:
        raise ShapeError("a polyhedron needs contacts in space")
    count = len(gpis.contacts_m)
    point_sigma = gpis.noise_scale * gpis.observations.value_sigma_m[:count]
    seen = gpis.observations.gradient_sigma
    normal_sigma = gpis.noise_scale * (seen if len(seen) == count else np.full(count, _DEFAULT_NORMAL_SIGMA_rad))
    return weighted_contacts(gpis.contacts_m, gpis.normals, point_sigma, normal_sigma)


def _log_evidence(contacts: WeightedContacts, regular: RegularPlanes) -> float:
    """Log likelihood at the best planes, minus for each plane the narrowing of its prior by the contacts.

    This is Laplace's approximation of the integral over the planes, with uniform priors of normals over the sphere and
    of offsets over :data:`OFFSET_RANGE_m`. A regularity saves the penalty for one angle and costs the choice between
    yes and no.
    """
    count = len(contacts)
    scale = 0.5 * np.log(contacts.point_weights).sum() + 1.5 * np.log(contacts.normal_weights).sum()
    likelihood = -0.5 * regular.planes.chi_square + scale - 2 * count * np.log(2 * np.pi)
    angles = np.log(2.0) - regular.log_angle_areas
    offsets = np.log(OFFSET_RANGE_m) - 0.5 * np.log(2 * np.pi * regular.offset_variances_m2)
    saved = regular.saved * max(0.5 * float(angles.mean()) - np.log(2.0), 0.0)
    return float(likelihood - np.sum(angles + offsets) + saved)


def _drop_lone_planes(regular: RegularPlanes) -> RegularPlanes:
    """Remove planes of a single contact that lie close to others: this contact is most likely wrong.

    If there are many single contacts, all of them are most likely wrong.
    """
    planes = regular.planes
    similar = planes.normals @ planes.normals.T > np.cos(_SIMILAR_ANGLE_rad)
    similar &= np.abs(planes.offsets_m[:, None] - planes.offsets_m) < _SIMILAR_OFFSET_m
    np.fill_diagonal(similar, False)
    single = planes.sizes < _LEAST_SUPPORT
    kept = ~single | (~similar.any(axis=1) & (single.sum() <= _LARGEST_SINGLE_SHARE * len(planes.labels)))
    numbers = np.where(kept, np.cumsum(kept) - 1, -1)
    fewer = Planes(numbers[planes.labels], planes.normals[kept], planes.offsets_m[kept], planes.chi_square)
    return replace(
        regular,
        planes=fewer,
        middles_m=regular.middles_m[kept],
        turn_covariances=regular.turn_covariances[kept],
        offset_variances_m2=regular.offset_variances_m2[kept],
        log_angle_areas=regular.log_angle_areas[kept],
    )
