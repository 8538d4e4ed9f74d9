"""Propagates pose uncertainty into the surface that was estimated from contacts at these poses.

A shape model states the uncertainty of the surface for contacts at known poses. The poses of a trajectory are uncertain
too, and correlated: an error of a pose moves all contacts of its grasp, and the neighbouring poses with it. Where
contacts move along their normals the surface follows them; along the surface they move nothing. How well poses are
known depends on the shape: the field only binds neighbouring contacts to each other, an outline times a range of
heights those above each other too, and flat faces contacts all over the object.

A motion of all contacts as one body changes the place of the shape and not the shape, so that part is removed: the
result is the uncertainty of the surface after the best rigid alignment.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.model import FittedShape
from tactile_lab.slam.shape.planar.polygon import Polygon
from tactile_lab.slam.shape.solids.polyhedron import Polyhedron
from tactile_lab.slam.shape.solids.prism import Prism, on_walls
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR
from tactile_lab.slam.tracking.evidence.pose_evidence import PoseEvidence
from tactile_lab.slam.tracking.faces.facet_certainty import FacetCertainty


def propagate_pose_uncertainty(
    mesh: SurfaceMesh, shape: FittedShape, contact_map: ContactMap, noise: MotionNoise
) -> SurfaceMesh:
    """A surface with the pose uncertainty added to its sigma.

    Args:
        mesh: of the shape.
        shape: what it was made from.
        contact_map: the contacts in space at the poses of largest evidence; the first pose is given.
        noise: of the motion model.
    """
    if len(contact_map.placed) == 1:
        return mesh
    used = _walls(contact_map) if isinstance(shape, Prism) else contact_map
    axes = slice(0, used.dimension)
    change = _change(used, noise, mesh.vertices[:, axes], mesh.normals[:, axes], faceted=_has_flat_faces(shape))
    moved = _reshape(change, mesh, on_table=contact_map.space is PLANAR)
    return replace(mesh, sigma_m=np.sqrt(mesh.sigma_m**2 + np.einsum("qm,qm->q", moved, moved)))


def _change(contact_map: ContactMap, noise: MotionNoise, places_m: Array, normals: Array, *, faceted: bool) -> Array:
    """Displacement of a surface along its normals by independent standard normal variables, shape (q, m).

    Args:
        contact_map: see above, contacts in the plane or in space.
        noise: of the motion model.
        places_m, normals: of the surface, shape (q, d); in the plane normals are shorter where it is inclined.
        faceted: the object has flat faces.
    """
    if faceted:
        try:
            certainty = FacetCertainty.of(contact_map, noise)
        except ShapeError:  # the contacts enclose nothing without the rest: what the field binds is all there is
            return _change(contact_map, noise, places_m, normals, faceted=False)
        information, change = certainty.information_of_poses, certainty.surface_change(places_m, normals)
    else:
        evidence = PoseEvidence(contact_map, noise)
        information, change = evidence.information(contact_map.rows), evidence.field_change(contact_map.rows, places_m)
    root = np.linalg.inv(np.linalg.cholesky(information)).T
    return np.asarray(change @ root * np.linalg.norm(normals, axis=1, keepdims=True))


def _reshape(change: Array, mesh: SurfaceMesh, *, on_table: bool) -> Array:
    """Displacements along the normals after the best rigid motion of the surface is removed."""
    arms, normals = mesh.vertices - mesh.vertices.mean(axis=0), mesh.normals
    turning = np.cross(arms, normals)
    rigid = np.column_stack([normals[:, :2], turning[:, 2]] if on_table else [normals, turning])
    return np.asarray(change - rigid @ np.linalg.lstsq(rigid, change, rcond=None)[0])


def _has_flat_faces(shape: FittedShape) -> bool:
    if isinstance(shape, Prism):
        return _has_flat_faces(shape.outline)
    return isinstance(shape, Polygon | Polyhedron)


def _walls(contact_map: ContactMap) -> ContactMap:
    """The contacts on upright walls seen from above, at the same poses, with the best kernel for them."""
    placed = tuple(_project_down(grasp) for grasp in contact_map.placed)
    return replace(contact_map, placed=placed).with_best_kernel()


def _project_down(grasp: PlacedGrasp) -> PlacedGrasp:
    kept = grasp.kept_world
    walls = kept.select(on_walls(kept.normals))
    level = walls.normals[:, :2] / np.linalg.norm(walls.normals[:, :2], axis=1, keepdims=True)
    flat = ContactSet(walls.points_m[:, :2], level, walls.point_sigma_m, walls.normal_sigma_rad, np.empty((0, 2)))
    return replace(grasp, contacts_world=flat, left_out=frozenset())
