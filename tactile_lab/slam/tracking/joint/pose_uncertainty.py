"""Propagates pose uncertainty into the surface that was estimated from contacts at these poses.

A shape model states the uncertainty of the surface for contacts at known poses. The poses of a trajectory are uncertain
too, and correlated: an error of a pose moves all contacts of its grasp, and the neighbouring poses with it. Where
contacts move along their normals the surface follows them; along the surface they move nothing. How well poses are
known depends on the shape: the field only binds neighbouring contacts to each other, an outline times a range of
heights those above each other too, and flat faces contacts all over the object.

A motion of all contacts as one body changes the place of the shape and not the shape, so that part is removed, from
the model's own part of an outline's variance too: the result is the uncertainty after the best rigid alignment
(decision 97).

Errors that all contacts of one finger share (:mod:`shared_errors`) are propagated in the same way, through the poses
and the faces that adapt to them. A contact's variance, which weighs it, contains them too: what they add to the surface
as if drawn anew for each contact is taken away, so that they count once (decision 74).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from scipy.spatial import cKDTree

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis_shape import GpisShape
from tactile_lab.slam.shape.model import FittedShape
from tactile_lab.slam.shape.planar.polygon import Polygon
from tactile_lab.slam.shape.planar.rounded_outline import RoundedOutline
from tactile_lab.slam.shape.solids.polyhedron import Polyhedron
from tactile_lab.slam.shape.solids.prism import Prism, on_walls
from tactile_lab.slam.shape.surfaces.surface import Contour, RESOLUTION_m, SurfaceMesh
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR
from tactile_lab.slam.tracking.evidence.pose_evidence import PoseEvidence
from tactile_lab.slam.tracking.faces.facet_certainty import FacetCertainty
from tactile_lab.slam.tracking.faces.side_certainty import SideCertainty
from tactile_lab.slam.tracking.faces.walls import walls_from_above

_Extracted = TypeVar("_Extracted", Contour, SurfaceMesh)


def propagate_pose_uncertainty(
    extracted: _Extracted, shape: FittedShape, contact_map: ContactMap, noise: MotionNoise
) -> _Extracted:
    """An outline or surface with two more parts in its sigma: the poses', and what contacts of one finger share, which
    is counted once.

    Args:
        extracted: of the shape.
        shape: what it was made from.
        contact_map: the contacts at the poses of largest evidence; the first pose is given.
        noise: of the motion model.
    """
    if len(contact_map.placed) == 1:
        return extracted
    places_m = extracted.points_m if isinstance(extracted, Contour) else extracted.vertices
    normals = extracted.normals
    used = walls_from_above(contact_map) if isinstance(shape, Prism) else contact_map
    axes = slice(0, used.dimension)
    changes = _changes(used, noise, places_m[:, axes], normals[:, axes], shape)
    fit = _BestFit.of(places_m, normals, extracted.sigma_m, on_table=contact_map.space is PLANAR)
    by_poses, by_fingers, as_if_anew = (_variance(fit.leaves(each)) for each in changes)
    anew = np.maximum(extracted.sigma_m**2 - _taken(extracted, shape, fit), 0.0) + by_poses
    least = _least_own_share(used.contacts_world) * anew
    return replace(
        extracted,
        sigma_m=np.sqrt(np.maximum(anew - as_if_anew, least) + by_fingers),
        shared_sigma_m=float(np.sqrt(np.median(by_fingers))),
    )


def _taken(extracted: Contour | SurfaceMesh, shape: FittedShape, fit: _BestFit) -> Array:
    """By how much the best fit reduces the model's own variance at each place, shape (q,); 0 where it is not known."""
    if isinstance(extracted, Contour) and isinstance(shape, Polygon | RoundedOutline | GpisShape):
        return fit.takes(shape.covariance_m2(extracted.points_m))
    if isinstance(extracted, SurfaceMesh) and isinstance(shape, Polyhedron):
        moves = shape.moves_m(extracted.vertices, extracted.normals)
        return _variance(moves) - _variance(fit.leaves(moves))
    taken = np.zeros(len(extracted.sigma_m))
    if isinstance(extracted, SurfaceMesh) and isinstance(shape, Prism):
        walls, section = on_walls(extracted.normals), shape.section
        of_section = _BestFit.of(section.points_m, section.normals, section.sigma_m, on_table=True)
        nearest = cKDTree(section.points_m).query(extracted.vertices[walls, :2])[1]
        taken[walls] = _taken(section, shape.outline, of_section)[nearest]
    return taken


def _variance(change: Array) -> Array:
    return np.asarray(np.einsum("qm,qm->q", change, change))


def _least_own_share(contacts: ContactSet) -> float:
    """Smallest part of a contact's variance that is drawn anew: that of the surface by contacts cannot shrink below."""
    shared = contacts.shared.of_count(len(contacts)).sigma_m ** 2
    return float(np.clip(1 - shared / contacts.point_sigma_m**2, 0.0, 1.0).min())


def _changes(
    contact_map: ContactMap, noise: MotionNoise, places_m: Array, normals: Array, shape: FittedShape
) -> tuple[Array, Array, Array]:
    """Displacements of a surface along its normals by independent standard normal variables, shapes (q, m): by the
    poses, by what contacts of one finger share, and by the same if it were drawn anew for each contact.

    Args:
        contact_map: see above, contacts in the plane or in space.
        noise: of the motion model.
        places_m, normals: of the surface, shape (q, d); in the plane normals are shorter where it is inclined.
        shape: of the object, whose sides or faces bind the poses.
    """
    certainty = _certainty(contact_map, noise, shape)
    if _is_sharp(shape) and certainty is not None:
        information, change = certainty.information_of_poses, certainty.surface_change(places_m, normals)
    else:
        evidence = PoseEvidence(contact_map, noise)
        information, change = evidence.information(contact_map.rows), evidence.field_change(contact_map.rows, places_m)
    root = np.linalg.inv(np.linalg.cholesky(information)).T
    shared, each = _shared_changes(contact_map, certainty, places_m, normals)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(change @ root * lengths), np.asarray(shared * lengths), np.asarray(each * lengths)


def _shared_changes(
    contact_map: ContactMap, certainty: FacetCertainty | SideCertainty | None, places_m: Array, normals: Array
) -> tuple[Array, Array]:
    """Displacement of a surface by what the contacts of each finger share, shape (q, fingers), and by the same if each
    contact had it by itself, shape (q, n).

    Where no faces say how the poses adapt, each finger counts by its number of contacts all over the object.
    """
    if certainty is not None:
        return certainty.shared_change(places_m, normals), certainty.shared_change_each(places_m, normals)
    shared = contact_map.contacts_world.shared
    alike = shared.displacements_m().mean(axis=0), shared.displacements_each_m().mean(axis=0)
    return np.tile(alike[0], (len(places_m), 1)), np.tile(alike[1], (len(places_m), 1))


@dataclass(frozen=True)
class _BestFit:
    """What the best rigid fit of a surface to the true one makes of the surface's displacements along its normals.

    Attributes:
        by_motions: displacement of each place by each motion, shape (q, k).
        motions: that are fitted to displacements, shape (k, q).
    """

    by_motions: Array
    motions: Array

    @classmethod
    def of(cls, places_m: Array, normals: Array, sigma_m: Array, *, on_table: bool) -> _BestFit:
        """Of a surface with standard deviations, shape (q,), by which its places count."""
        arms = places_m - places_m.mean(axis=0)
        if places_m.shape[1] == 2:
            rigid = np.column_stack([normals, arms[:, 0] * normals[:, 1] - arms[:, 1] * normals[:, 0]])
        else:
            turning = np.cross(arms, normals)
            rigid = np.column_stack([normals[:, :2], turning[:, 2]] if on_table else [normals, turning])
        weights = 1 / np.hypot(sigma_m, RESOLUTION_m)
        return cls(rigid, np.linalg.pinv(rigid * weights[:, None]) * weights)

    def leaves(self, change: Array) -> Array:
        """Displacements, shape (q, m), without the best motion."""
        return np.asarray(change - self.by_motions @ (self.motions @ change))

    def takes(self, covariance_m2: Array) -> Array:
        """By how much it reduces the variance of displacements with this covariance, shapes (q,) and (q, q)."""
        with_motions = covariance_m2 @ self.motions.T
        of_motions = self.by_motions @ (self.motions @ with_motions)
        return np.asarray(np.sum(self.by_motions * (2 * with_motions - of_motions), axis=1))


def _certainty(
    contact_map: ContactMap, noise: MotionNoise, shape: FittedShape
) -> FacetCertainty | SideCertainty | None:
    """Of the outline's sides where some are round, otherwise of flat faces; None if these enclose nothing."""
    try:
        if isinstance(_outline(shape), RoundedOutline):
            return SideCertainty.of(contact_map, noise)
        return FacetCertainty.of(contact_map, noise)
    except (ShapeError, np.linalg.LinAlgError):  # the contacts enclose nothing without the rest
        return None


def _is_sharp(shape: FittedShape) -> bool:
    return isinstance(_outline(shape), Polygon | RoundedOutline | Polyhedron)


def _outline(shape: FittedShape) -> FittedShape:
    """A prism's outline; of other shapes themselves."""
    return shape.outline if isinstance(shape, Prism) else shape
