"""Smooths poses and flat faces together.

The faces take the place of the field in :mod:`pose_evidence`: every contact lies on its face and its normal is the
face's, up to the sensors' noise, and successive poses follow the motion model. All of it is one least-squares
problem in the poses and the faces, in the plane and in space alike. A few faces bind contacts all over the object
together where the field only binds neighbours, so that poses become as certain as the contacts are. Faces that are
parallel, at right angles, upright or level (:mod:`regular_faces`) stay so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.planar.segmentation import price_of_face
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.evidence.motion_cost import MotionCost
from tactile_lab.slam.tracking.faces.bends import Bends
from tactile_lab.slam.tracking.faces.damped_steps import descend
from tactile_lab.slam.tracking.faces.face_extents import overhang
from tactile_lab.slam.tracking.faces.flat_faces import FlatFaces, Neighbours, flat_faces, tangents
from tactile_lab.slam.tracking.faces.joint_weights import JointWeights
from tactile_lab.slam.tracking.faces.solid_face_extents import SolidFaceExtents

_MOST_PLANES_SHARE = 0.25
"""Solids whose planes have less than four contacts each on average are not faceted."""

_LARGEST_FOLD = float(np.cos(np.deg2rad(35.0)))
"""Faces that meet at a larger angle are never merged."""

_REGULAR_rad = 3e-4
"""Standard deviation of regularities: far below the contacts' resolution, and loose enough for the iteration."""


@dataclass(frozen=True)
class FacetedTrajectory:
    """Poses and faces that fit each other.

    Attributes:
        rows: poses, shape (k, size).
        faces: in the object frame.
        chi_square: of contacts and normals against the faces.
        motion_cost: negative log probability of the slips.
    """

    rows: Array
    faces: FlatFaces
    chi_square: float
    motion_cost: float

    @property
    def cost(self) -> float:
        """Negative log posterior, without the price of the faces."""
        return 0.5 * self.chi_square + self.motion_cost

    def description_length(self, price: float) -> float:
        """Twice the cost, and the price of the faces."""
        return 2 * self.cost + self.faces.count * price


class FacetSmoother:
    """Least squares over the poses of a map and the faces of its contacts."""

    def __init__(
        self,
        contact_map: ContactMap,
        noise: MotionNoise,
        ends: SolidFaceExtents | None = None,
        bends: Bends | None = None,
    ) -> None:
        """
        Args:
            contact_map: the poses and contacts.
            noise: of the motion model.
            ends: where the faces of a solid end; None in the plane, and where no face is known to end.
            bends: how a round surface turns at the contacts, which :meth:`information` then allows for; None if faces
                are flat.
        """
        self._space, self._ends, self._bends = contact_map.space, ends, bends
        self._motion = MotionCost.of(contact_map, noise)
        self._world = contact_map.contacts_world
        self._grasp_of = contact_map.grasp_indices
        self._weights = JointWeights.of(self._world)

    def fit(self, rows: Array, faces: FlatFaces, iterations: int) -> FacetedTrajectory:
        """The best poses and faces near the given ones, contacts keeping their faces (Levenberg-Marquardt).

        Args:
            rows: poses to start from, shape (k, size); the first stays.
            faces: to start from.
            iterations: at most.
        """
        return descend(self._rate(rows, faces), self._normal_equations, self._step, iterations)

    def simplify(self, rows: Array, faces: FlatFaces, price: float, neighbours: Neighbours) -> FacetedTrajectory:
        """Merge neighbouring faces as long as that costs less than the price of a face, while the poses adapt.

        The cost of a merger is predicted from the joint covariance of all faces and poses, and then verified.

        Args:
            rows, faces: to start from.
            price: chi-square that a face must save.
            neighbours: pairs of faces that may be merged.
        """
        best = self.fit(rows, faces, 15)
        refused: set[tuple[int, int]] = set()
        while best.faces.count > 3:
            costs = self._merger_costs(best, [pair for pair in neighbours(best.faces) if pair not in refused])
            if not costs or min(costs.values()) > 2 * price:
                return best
            kept, dropped = min(costs, key=costs.__getitem__)
            merged = self.fit(best.rows, best.faces.merge(kept, dropped), 10)
            if 2 * (merged.cost - best.cost) < price:
                best, refused = merged, set[tuple[int, int]]()
            else:
                refused.add((kept, dropped))
        return best

    def information(self, rows: Array, faces: FlatFaces, *, given_errors: bool = False) -> Array:
        """Gauss-Newton information by all poses but the first, then by each face's tilt and offset.

        Args:
            rows, faces: the solution.
            given_errors: as if the errors that contacts of one finger share were known, where they were estimated.
        """
        at = self._rate(rows, faces)
        return self._information(at, self._jacobian_given_errors(at) if given_errors else self._jacobian(at))

    def response(self, rows: Array, faces: FlatFaces, displacements_m: Array) -> Array:
        """How poses but the first, and each face's tilt and offset, follow contacts that move along their normals.

        Args:
            rows, faces: the solution.
            displacements_m: of the contacts, shape (n, m).

        Returns:
            Changes of these unknowns, shape (unknowns, m).
        """
        at = self._rate(rows, faces)
        jacobian = self._jacobian(at)
        moved = jacobian[: len(displacements_m)].T @ (displacements_m / self._world.point_sigma_m[:, None])
        return np.asarray(-np.linalg.solve(self._information(at, jacobian), moved))

    def shared_errors(self, at: FacetedTrajectory) -> Array:
        """The likeliest errors that contacts of one finger share, standard deviations, shape (m,)."""
        return self._weights.errors(self._away_m(at.faces, self._seen(at.rows)[0]) / self._world.point_sigma_m)

    def by_shared_errors(self, rows: Array, faces: FlatFaces) -> Array:
        """How poses but the first, and each face's tilt and offset, follow what remains unknown of these errors.

        Args:
            rows, faces: the solution.

        Returns:
            By independent standard normal variables, shape (unknowns, m).
        """
        at = self._rate(rows, faces)
        jacobian = self._jacobian_given_errors(at)
        return self._weights.unknown(self._information(at, jacobian), jacobian[: len(self._world)])

    def _rate(self, rows: Array, faces: FlatFaces) -> FacetedTrajectory:
        chi_square = float(np.sum(self._residuals(rows, faces) ** 2))
        return FacetedTrajectory(rows, faces, chi_square, self._motion.value(rows))

    def _residuals(self, rows: Array, faces: FlatFaces) -> Array:
        """Of values, of the normals' components one after the other, beyond the faces' ends, and of regularities."""
        points, normals = self._seen(rows)
        away = self._away_m(faces, points) / self._world.point_sigma_m
        tilts = np.where(faces.leaning[:, None], 0.0, normals - faces.normals[faces.labels])
        parts = [
            self._weights.whiten(away),
            (tilts / self._world.normal_sigma_rad[:, None]).T.ravel(),
        ]
        if points.shape[1] == 2:
            over = overhang(points, faces.labels, faces.normals, faces.offsets_m)
            parts.append(over.beyond_m * faces.bounded / self._world.sideways_sigma_m)
        if self._ends is not None:
            parts.append(np.maximum(self._ends.beyond(points, faces.normals, faces.offsets_m), 0.0))
        parts.append(faces.irregularity() / _REGULAR_rad)
        return np.concatenate(parts)

    def _seen(self, rows: Array) -> tuple[Array, Array]:
        """Points and normals of the contacts, object frame."""
        return self._space.to_object(rows[self._grasp_of], self._world.points_m, self._world.normals)

    @staticmethod
    def _away_m(faces: FlatFaces, points: Array) -> Array:
        """How far contacts lie outside of their faces, shape (n,)."""
        return np.asarray(np.einsum("nd,nd->n", faces.normals[faces.labels], points) - faces.offsets_m[faces.labels])

    def _normal_equations(self, at: FacetedTrajectory) -> tuple[Array, Array]:
        """Gauss-Newton information and gradient by all poses but the first, then by each face's tilt and offset."""
        jacobian = self._jacobian(at)
        gradient = jacobian.T @ self._residuals(at.rows, at.faces)
        slips = self._motion.value_and_gradient(at.rows)[1][1:].ravel()
        gradient[: len(slips)] += slips
        return self._information(at, jacobian), gradient

    def _information(self, at: FacetedTrajectory, jacobian: Array) -> Array:
        information = jacobian.T @ jacobian
        free = (len(at.rows) - 1) * self._space.size
        information[:free, :free] += self._motion.information(at.rows)
        information[np.diag_indices_from(information)] += 1e-9 * np.trace(information) / len(information)
        return np.asarray(information)

    def _jacobian(self, at: FacetedTrajectory) -> Array:
        """Derivatives of the residuals."""
        jacobian, count = self._jacobian_given_errors(at), len(self._world)
        jacobian[:count] = self._weights.whiten(jacobian[:count])
        return jacobian

    def _jacobian_given_errors(self, at: FacetedTrajectory) -> Array:
        """The same before those of contacts that share errors are made uncorrelated."""
        rows, faces, world = at.rows, at.faces, self._world
        points, normals = self._seen(rows)
        count, dimension = points.shape
        contact, still, each = np.arange(count), np.zeros_like(normals), rows[self._grasp_of]
        along = tangents(faces.normals)[faces.labels]
        outward = faces.normals[faces.labels] if self._bends is None else self._bends.normals
        turning = np.zeros((count, dimension, dimension)) if self._bends is None else self._bends.turning
        blocks = 4 if dimension == 2 else dimension + 1
        by_poses = np.zeros((blocks * count, len(rows), self._space.size))
        by_faces = np.zeros((blocks * count, faces.count, dimension))
        value = self._space.by_row(each, points, normals, outward, still)
        by_poses[contact, self._grasp_of] = value / world.point_sigma_m[:, None]
        stiffness = ~faces.leaning / world.normal_sigma_rad
        tilt = np.column_stack([np.einsum("ndt,nd->nt", along, points), -np.ones(count)])
        by_faces[contact, faces.labels] = tilt / world.point_sigma_m[:, None]
        for axis in range(dimension):
            unit = np.broadcast_to(np.eye(dimension)[axis], normals.shape)
            lines = (axis + 1) * count + contact
            turned = self._space.by_row(each, points, normals, -turning[:, axis], unit)
            by_poses[lines, self._grasp_of] = turned * stiffness[:, None]
            by_faces[lines, faces.labels, :-1] = -along[:, axis] * stiffness[:, None]
        if dimension == 2:
            over, lines = overhang(points, faces.labels, faces.normals, faces.offsets_m), 3 * count + contact
            strength = (faces.bounded / world.sideways_sigma_m)[:, None]
            by_poses[lines, self._grasp_of] = self._space.by_row(each, points, normals, over.ways, still) * strength
            by_faces[lines, :, 1] = over.by_offsets * strength
        if self._ends is not None:
            ended = self._by_ends(self._ends, at, points, normals)
            by_poses, by_faces = np.concatenate([by_poses, ended[0]]), np.concatenate([by_faces, ended[1]])
        tied = faces.irregularity_by_faces() / _REGULAR_rad
        by_faces = np.concatenate([by_faces, tied])
        free = np.pad(by_poses[:, 1:], ((0, len(tied)), (0, 0), (0, 0)))
        return np.hstack([free.reshape(len(free), -1), by_faces.reshape(len(by_faces), -1)])

    def _by_ends(
        self, ends: SolidFaceExtents, at: FacetedTrajectory, points: Array, normals: Array
    ) -> tuple[Array, Array]:
        """Derivatives of how far contacts lie beyond the ends of a solid's faces, by poses and by faces."""
        faces, grasp = at.faces, self._grasp_of[ends.contacts]
        over = ends.strengths * (ends.beyond(points, faces.normals, faces.offsets_m) > 0)
        ended, line = faces.normals[ends.faces], np.arange(len(over))
        points, normals = points[ends.contacts], normals[ends.contacts]
        by_poses = np.zeros((len(line), len(at.rows), self._space.size))
        by_faces = np.zeros((len(line), faces.count, points.shape[1]))
        by_point = over[:, None] * ended
        by_poses[line, grasp] = self._space.by_row(at.rows[grasp], points, normals, by_point, np.zeros_like(normals))
        tilt = np.einsum("ndt,nd->nt", tangents(ended), points)
        by_faces[line, ends.faces] = over[:, None] * np.column_stack([tilt, -np.ones(len(line))])
        return by_poses, by_faces

    def _step(self, at: FacetedTrajectory, step: Array) -> FacetedTrajectory:
        size, dimension = self._space.size, at.faces.normals.shape[1]
        free = (len(at.rows) - 1) * size
        rows = np.vstack([at.rows[:1], self._space.move(at.rows[1:], step[:free].reshape(-1, size))])
        changes = step[free:].reshape(-1, dimension)
        normals = at.faces.normals + np.einsum("sdt,st->sd", tangents(at.faces.normals), changes[:, :-1])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return self._rate(rows, replace(at.faces, normals=normals, offsets_m=at.faces.offsets_m + changes[:, -1]))

    def _merger_costs(self, at: FacetedTrajectory, pairs: list[tuple[int, int]]) -> dict[tuple[int, int], float]:
        """Chi-square by which making two faces one is expected to raise the total, for pairs that are nearly flat."""
        information = self._information(at, self._jacobian(at))
        free, dimension = (len(at.rows) - 1) * self._space.size, at.faces.normals.shape[1]
        covariance = np.linalg.inv(information)[free:, free:]
        costs = {}
        for one, other in pairs:
            normals, offsets = at.faces.normals[[one, other]], at.faces.offsets_m[[one, other]]
            if normals[0] @ normals[1] < _LARGEST_FOLD:
                continue
            lines = np.r_[one * dimension : (one + 1) * dimension, other * dimension : (other + 1) * dimension]
            both = covariance[np.ix_(lines, lines)].reshape(2, dimension, 2, dimension)
            spread = both[0, :, 0] + both[1, :, 1] - both[0, :, 1] - both[1, :, 0]
            change = np.append(tangents(normals[:1])[0].T @ (normals[1] - normals[0]), offsets[1] - offsets[0])
            costs[(one, other)] = float(change @ np.linalg.solve(spread, change))
        return costs


def smoothed_with_faces(contact_map: ContactMap, noise: MotionNoise, rounds: int = 3) -> FacetedTrajectory | None:
    """Divide a map's contacts into faces, and let poses, faces and the division settle.

    Returns:
        None if the contacts make no faces that enclose anything.
    """
    world = contact_map.contacts_world
    price = price_of_face(world.point_sigma_m, world.normal_sigma_rad)
    best: FacetedTrajectory | None = None
    for _ in range(rounds):
        try:
            faces, neighbours = flat_faces(contact_map)
        except ShapeError:  # nothing enclosed, or no faces in it
            return best
        if contact_map.dimension == 3 and faces.count > _MOST_PLANES_SHARE * len(faces.labels):
            return best  # round: planes would only follow the noise
        found = FacetSmoother(contact_map, noise).simplify(contact_map.rows, faces, price, neighbours)
        if best and found.description_length(price) >= best.description_length(price) - 1e-3:
            return best
        best, contact_map = found, contact_map.with_rows(found.rows)
    return best
