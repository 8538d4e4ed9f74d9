"""Smooths poses and the straight and round sides of an outline together.

As :mod:`facet_smoothing` does it with flat faces: every contact lies on its side and its normal is the side's, up to
the sensors' noise, and successive poses follow the motion model. Distances and normals are linear in the four numbers
of a side (:mod:`~tactile_lab.slam.shape.planar.sides`), so that round sides cost no more than straight ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.planar.rounded_outline import RoundedOutline
from tactile_lab.slam.shape.planar.sides import features, slopes
from tactile_lab.slam.shape.selection.planar_choice import rounded_of
from tactile_lab.slam.shape.solids.prism import on_walls
from tactile_lab.slam.shape.surfaces.surface import extract_contour
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR
from tactile_lab.slam.tracking.evidence.motion_cost import MotionCost
from tactile_lab.slam.tracking.faces.damped_steps import descend
from tactile_lab.slam.tracking.faces.joint_weights import JointWeights
from tactile_lab.slam.tracking.faces.walls import walls_from_above

_ORDERING_RESOLUTION_m = 0.002
_ROUNDS, _STEPS = 4, 15
_SETTLED_nats = 0.5


def rounded_outline(contact_map: ContactMap) -> RoundedOutline:
    """The straight and round sides of a map's contacts in the plane, in the map's order. Raises ShapeError."""
    fitted = contact_map.fit()
    return rounded_of(fitted, extract_contour(fitted, resolution_m=_ORDERING_RESOLUTION_m))


def smoothed_with_sides(contact_map: ContactMap, noise: MotionNoise) -> ContactMap | None:
    """Divide a map's contacts into sides, and let poses, sides and the division settle; None if no side is round, or
    none was touched.

    Args:
        contact_map: contacts in the plane, or in space, of which those on upright walls count.
        noise: of the motion model.
    """
    if "round sides" in contact_map.settings.without or contact_map.space is not PLANAR:
        return None
    if contact_map.dimension == 3 and not on_walls(contact_map.contacts_world.normals).any():
        return None
    best: tuple[float, ContactMap] | None = None
    seen = contact_map if contact_map.dimension == 2 else walls_from_above(contact_map)
    motion = MotionCost.of(seen, noise)
    for _ in range(_ROUNDS):
        try:
            outline = rounded_outline(seen)
        except ShapeError:  # nothing enclosed, or only flat faces
            break
        value = outline.log_evidence - motion.value(seen.rows)
        if best is not None and value <= best[0] + _SETTLED_nats:
            break
        best = value, seen
        seen = seen.with_rows(SideSmoother(seen, noise, outline).fit())
    return None if best is None else contact_map.with_rows(best[1].rows)


@dataclass(frozen=True)
class SidedTrajectory:
    """Poses and sides that fit each other.

    Attributes:
        rows: poses, shape (k, 3).
        numbers: of each side, about the outline's origin, shape (s, 4).
        cost: negative log posterior, without the price of the sides.
    """

    rows: Array
    numbers: Array
    cost: float


class SideSmoother:
    """Least squares over the poses of a map and the sides of its contacts.

    Args:
        contact_map: the poses and contacts.
        noise: of the motion model.
        outline: of these contacts, in their order.
    """

    def __init__(self, contact_map: ContactMap, noise: MotionNoise, outline: RoundedOutline) -> None:
        self._space, self._rows = contact_map.space, contact_map.rows
        self._motion = MotionCost.of(contact_map, noise)
        self._world, self._grasp_of = contact_map.contacts_world, contact_map.grasp_indices
        self._weights = JointWeights.of(self._world)
        self._origin_m = outline.sides[0].origin_m
        self._sides = np.empty(len(self._world), dtype=np.int64)
        for index, side in enumerate(outline.sides):
            self._sides[side.members] = index
        self._numbers = np.array([side.numbers for side in outline.sides])
        self._free: NDArray[np.bool_] = np.array([[side.is_round, True, True, True] for side in outline.sides])

    @property
    def start(self) -> SidedTrajectory:
        """The map's poses and the outline's sides."""
        return self._rate(self._rows, self._numbers)

    def fit(self) -> Array:
        """The best poses near the map's, contacts keeping their sides (Levenberg-Marquardt), shape (k, 3)."""
        return descend(self.start, self._normal_equations, self.moved, _STEPS).rows

    def information(self) -> Array:
        """Gauss-Newton information at the map's poses, by all poses but the first, then by each side's free numbers."""
        return self._normal_equations(self.start)[0]

    def response(self, displacements_m: Array) -> Array:
        """How these unknowns follow contacts that move along their normals.

        Args:
            displacements_m: of the contacts, shape (n, m).

        Returns:
            Shape (unknowns, m).
        """
        at = self.start
        pulled = self.jacobian(at)[: len(displacements_m)].T @ (displacements_m / self._world.point_sigma_m[:, None])
        return np.asarray(-np.linalg.solve(self._normal_equations(at)[0], pulled))

    def free_numbers(self, sides: NDArray[np.int64], places_m: Array) -> Array:
        """By how much each free number moves places on given sides outwards, shape (q, free numbers)."""
        rows = np.zeros((len(places_m), *self._numbers.shape))
        rows[np.arange(len(places_m)), sides] = -features(places_m - self._origin_m)
        return rows[:, self._free]

    def _rate(self, rows: Array, numbers: Array) -> SidedTrajectory:
        misfit = 0.5 * float(np.sum(self._misfits(rows, numbers) ** 2))
        return SidedTrajectory(rows, numbers, misfit + self._motion.value(rows))

    def _seen(self, rows: Array) -> tuple[Array, Array]:
        points, normals = self._space.to_object(rows[self._grasp_of], self._world.points_m, self._world.normals)
        return points - self._origin_m, normals

    def residuals(self, at: SidedTrajectory) -> Array:
        """Of values, then of the normals' components one after the other, in standard deviations, shape (3 n,)."""
        return self._misfits(at.rows, at.numbers)

    def _misfits(self, rows: Array, numbers: Array) -> Array:
        points, normals = self._seen(rows)
        own = numbers[self._sides]
        away = np.einsum("ni,ni->n", features(points), own) / self._world.point_sigma_m
        tilts = (np.einsum("nki,ni->nk", slopes(points), own) - normals) / self._world.normal_sigma_rad[:, None]
        return np.concatenate([self._weights.whiten(away), tilts.T.ravel()])

    def jacobian(self, at: SidedTrajectory) -> Array:
        """Derivatives of the residuals by all poses but the first, then by the free numbers of each side."""
        rows, world = at.rows, self._world
        points, normals = self._seen(rows)
        count, contact, each = len(points), np.arange(len(points)), rows[self._grasp_of]
        own, still, whole = at.numbers[self._sides], np.zeros_like(normals), points + self._origin_m
        by_poses = np.zeros((3 * count, len(rows), self._space.size))
        by_sides = np.zeros((3 * count, len(at.numbers), 4))
        gradients = np.einsum("nki,ni->nk", slopes(points), own)
        value = self._space.by_row(each, whole, normals, gradients, still)
        by_poses[contact, self._grasp_of] = value / world.point_sigma_m[:, None]
        by_sides[contact, self._sides] = features(points) / world.point_sigma_m[:, None]
        stiffness = 1 / world.normal_sigma_rad[:, None]
        for axis in range(2):
            unit = np.broadcast_to(np.eye(2)[axis], normals.shape)
            lines = (axis + 1) * count + contact
            turned = self._space.by_row(each, whole, normals, 2 * own[:, :1] * unit, -unit)
            by_poses[lines, self._grasp_of] = turned * stiffness
            by_sides[lines, self._sides] = slopes(points)[:, axis] * stiffness
        jacobian = np.hstack([by_poses[:, 1:].reshape(3 * count, -1), by_sides[:, self._free]])
        jacobian[:count] = self._weights.whiten(jacobian[:count])
        return jacobian

    def _normal_equations(self, at: SidedTrajectory) -> tuple[Array, Array]:
        jacobian = self.jacobian(at)
        gradient, information = jacobian.T @ self.residuals(at), jacobian.T @ jacobian
        slips = self._motion.value_and_gradient(at.rows)[1][1:].ravel()
        gradient[: len(slips)] += slips
        information[: len(slips), : len(slips)] += self._motion.information(at.rows)
        information[np.diag_indices_from(information)] += 1e-9 * np.trace(information) / len(information)
        return np.asarray(information), gradient

    def moved(self, at: SidedTrajectory, step: Array) -> SidedTrajectory:
        """The same after a change of the unknowns, in the order of :meth:`jacobian`'s columns."""
        poses = (len(at.rows) - 1) * self._space.size
        rows = np.vstack([at.rows[:1], self._space.move(at.rows[1:], step[:poses].reshape(-1, self._space.size))])
        numbers = at.numbers.copy()
        numbers[self._free] += step[poses:]
        return self._rate(rows, numbers)
