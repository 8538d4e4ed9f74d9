"""The facet model in the plane: an outline of straight faces that meet in sharp corners."""

from __future__ import annotations

from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.planar.corners import Corners
from tactile_lab.slam.shape.planar.joints import Joint, JointMaker
from tactile_lab.slam.shape.planar.outlines import is_simple
from tactile_lab.slam.shape.planar.segmentation import Faces, PlanarContacts, log_evidence
from tactile_lab.slam.shape.planar.uncertainty import FaceUncertainty
from tactile_lab.slam.shape.surfaces.sampling import polygon_area
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

LEAST_FACES = 3

BRIDGE = -1
"""Face number of parts of the outline that no face covers."""


_BEFORE_CORNER = 1 - 1e-9
"""Of an edge: a corner belongs to the edge that begins there."""


class Polygon:
    """An outline of straight faces; a :class:`FittedShape`. Made by :meth:`of`.

    Attributes:
        name: "polygon".
        contacts: those that lie on faces.
        faces: assignment of these contacts to faces.
        corner_contacts: the others, each at one of the corners.
        outline_m: vertices of the simple closed outline, counter-clockwise, shape (k, 2): its corners, and the points
            of bridges where two neighbouring faces do not meet in a plausible corner.
        vertex_sigma_m: standard deviation across the outline at the points of bridges, NaN at corners, shape (k,).
        edge_faces: face of the edge from each vertex to the next, or :data:`BRIDGE`, shape (k,).
        cuts: of each vertex, what may be hidden there; None at points of bridges.
    """

    name = "polygon"

    def __init__(
        self, contacts: PlanarContacts, faces: Faces, joints: list[Joint], corner_contacts: PlanarContacts
    ) -> None:
        self.contacts, self.faces, self.corner_contacts = contacts, faces, corner_contacts
        self.outline_m = np.vstack([joint.points_m for joint in joints])
        self.vertex_sigma_m = np.concatenate([joint.sigma_m for joint in joints])
        following = [[BRIDGE] * (len(joint.points_m) - 1) + [(i + 1) % len(joints)] for i, joint in enumerate(joints)]
        self.edge_faces = np.concatenate(following).astype(np.int64)
        self.cuts = [joint.cut for joint in joints for _ in joint.points_m]

    @classmethod
    def of(
        cls,
        contacts: PlanarContacts,
        faces: Faces,
        provisional: Contour | None = None,
        corner_contacts: PlanarContacts | None = None,
    ) -> Self:
        """Make the outline from faces, each of which meets its neighbours.

        Args:
            contacts: the contacts in which the faces were found.
            faces: at least three.
            provisional: an outline from which corners must not deviate, and that bridges gaps where faces do not meet;
                straight lines bridge gaps if it is None or detours far.
            corner_contacts: further contacts, which lie at corners and not on the faces.

        Raises:
            ShapeError: there are fewer than three faces, or they do not enclose one simple region.
        """
        if faces.count < LEAST_FACES:
            raise ShapeError(f"{faces.count} faces enclose nothing", hint="Contacts on three sides are needed")
        maker = JointMaker(contacts, faces, provisional)
        joints = [maker.between(i, (i + 1) % faces.count) for i in range(faces.count)]
        none = contacts.select(np.zeros(len(contacts), dtype=bool))
        polygon = cls(contacts, faces, joints, corner_contacts or none)
        if polygon_area(polygon.outline_m) > 0 and is_simple(polygon.outline_m):
            return polygon
        raise ShapeError("the faces do not enclose one region", hint="More contacts near the corners would help")

    @cached_property
    def log_evidence(self) -> float:
        """Comparable with the log marginal likelihood of a field from the same contacts; see :func:`log_evidence`."""
        on_faces, at_corners, faces = self.contacts, self.corner_contacts, self.faces
        chi_square = faces.chi_square + float(self.corners.chi_squares(at_corners).sum())
        point_sigma_m = np.append(on_faces.point_sigma_m, at_corners.point_sigma_m)
        normal_sigma_rad = np.append(on_faces.normal_sigma_rad, at_corners.normal_sigma_rad)
        return log_evidence(chi_square, faces.count, point_sigma_m, normal_sigma_rad) + faces.regularity_nats

    @property
    def corners(self) -> Corners:
        """Convex corners, which a fingertip may straddle."""
        before, after = np.roll(self.edge_faces, 1)[self._is_corner], self.edge_faces[self._is_corner]
        return Corners.between(self.faces, np.column_stack([before, after]))

    @property
    def misfits(self) -> tuple[Array, Array]:
        """How far each contact lies from its face's line, and how far its normal is turned from the face's, (n,)."""
        normals = self.faces.normals[self.faces.labels]
        across_m = np.abs(np.sum(self.contacts.points_m * normals, axis=1) - self.faces.offsets_m[self.faces.labels])
        return across_m, np.arccos(np.clip(np.sum(self.contacts.normals * normals, axis=1), -1.0, 1.0))

    @cached_property
    def uncertainty(self) -> FaceUncertainty:
        """Uncertainty of the faces, including the observed scatter."""
        return FaceUncertainty.of(self.contacts, self.faces).scale(_scatter(self.contacts, self.faces))

    @property
    def corners_m(self) -> Array:
        """Where two faces meet, counter-clockwise, shape (c, 2); fewer than faces if there are bridges."""
        return np.asarray(self.outline_m[self._is_corner])

    def contour(self, resolution_m: float = 0.001) -> Contour:
        """The outline with every corner; sigma across it from the covariance of the faces and what may be hidden at
        corners, or of the bridges.
        """
        points, sigmas = [], []
        ends, end_sigmas = np.roll(self.outline_m, -1, axis=0), np.roll(self.vertex_sigma_m, -1)
        for i, (start, end, face) in enumerate(zip(self.outline_m, ends, self.edge_faces, strict=True)):
            steps = max(1, int(np.ceil(np.linalg.norm(end - start) / resolution_m)))
            share = np.arange(steps) / steps
            places = start + share[:, None] * (end - start)
            points.append(places)
            if face == BRIDGE:
                sigmas.append((1 - share) * self.vertex_sigma_m[i] + share * end_sigmas[i])
            else:
                sigmas.append(np.sqrt(self.uncertainty.variance_m2(face, places) + self._hidden_m2(i, places)))
        return Contour(np.vstack(points), np.concatenate(sigmas), is_closed=True)

    def _hidden_m2(self, edge: int, places_m: Array) -> Array:
        """Mean square distance of places on an edge, shape (q, 2), from what may be hidden at its two corners."""
        hidden_m2 = np.zeros(len(places_m))
        for vertex in (edge, (edge + 1) % len(self.cuts)):
            if (cut := self.cuts[vertex]) is not None:
                away_m = np.linalg.norm(places_m - self.outline_m[vertex], axis=1)
                hidden_m2 += cut.variance_m2(away_m, after=vertex == edge)
        return hidden_m2

    def covariance_m2(self, places_m: Array) -> Array:
        """Covariance of displacements along the normals at places on the outline, shapes (q, 2) and (q, q).

        That of the faces: bridges and what may be hidden at corners have no part in it.
        """
        moves = self.uncertainty.displacements_m(self._faces_at(places_m), places_m)
        return np.asarray(moves @ moves.T)

    def _faces_at(self, places_m: Array) -> NDArray[np.int64]:
        """Face of the nearest edge, that after a corner at the corner itself, shape (q,)."""
        edges = np.roll(self.outline_m, -1, axis=0) - self.outline_m
        along = np.einsum("qkd,kd->qk", places_m[:, None] - self.outline_m, edges) / np.sum(edges**2, axis=1)
        feet = self.outline_m + np.clip(along, 0.0, _BEFORE_CORNER)[..., None] * edges
        return np.asarray(self.edge_faces[np.linalg.norm(places_m[:, None] - feet, axis=2).argmin(axis=1)])

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        """Raises ShapeError: an outline has no surface."""
        raise ShapeError("a polygon is an outline in the plane and has no surface")

    @property
    def _is_corner(self) -> Array:
        return np.asarray((self.edge_faces != BRIDGE) & (np.roll(self.edge_faces, 1) != BRIDGE))


def _scatter(contacts: PlanarContacts, faces: Faces) -> float:
    """Root of chi-square per degree of freedom, at least one; above one if contacts scatter more than stated."""
    freedom = 2 * len(contacts) - faces.count - len(np.unique(faces.direction_groups))
    return float(np.sqrt(max(1.0, faces.chi_square / freedom))) if freedom > 0 else 1.0
