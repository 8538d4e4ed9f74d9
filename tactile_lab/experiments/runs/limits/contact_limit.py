"""The Cramér-Rao bound for an object with flat sides: how well grasps can determine its sides and poses at best.

The errors of an efficient estimate have the inverse of the contacts' information matrix as their covariance. Unknown
are the sides, whose number and neighbours are given, and the object's pose at every grasp but the first, which fixes
the frame. Each contact lies on its side and points along its normal, up to the sensors' noise; between grasps the
object slips by the noise of the motion, in the plane or on a table. Each run draws one error from this covariance, and
its shape and poses are evaluated like those of an estimate. No estimator runs here. An estimator can do better than
this bound only with additional knowledge, for instance that sides tend to be parallel, or that contacts lie between the
ends of their sides.

Sides may also be *regular*: then it is known which of them are parallel or perpendicular to each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gtsam import Pose3
from numpy.typing import NDArray
from scipy.optimize import approx_fprime

from drivers.core.contacts import Array
from drivers.core.poses import planar, spatial, transform_points
from tactile_lab.experiments.data.sensing import (
    NORMAL_SIGMA_rad,
    POINT_SIGMA_m,
    SimulatedGrasps,
    SLIP_SIGMA_m,
    SLIP_SIGMA_rad,
    planar_pose,
)
from tactile_lab.experiments.groups import REFERENCE_METHOD
from tactile_lab.slam.tracking.contacts.motion import (
    MotionNoise,
    compose,
    deviation,
    inverse,
    planar_motion,
    pose_vector,
    vector_pose,
)
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR

SIDES = ("free", "regular")
METHODS = (REFERENCE_METHOD, "estimated-pose")

_STEP = 1e-7
_ALIKE_rad = 1e-9
_REACH_m, _REACH_rad = 0.050, 1.0
"""Prior for a side without contacts: it lies within the hand."""


@dataclass(frozen=True)
class FlatSides:
    """Sides ``u . x = distance``, and the directions in which they may vary.

    Attributes:
        normals: outward unit normals u, shape (n, d).
        distances_m: shape (n,).
        turning: of the normals by each unknown angle, shape (n, d, a).
        sliding: of the distances by each unknown displacement, shape (n, b).
    """

    normals: Array
    distances_m: Array
    turning: Array
    sliding: Array

    @property
    def unknown(self) -> tuple[int, int]:
        """The number of angles and displacements."""
        return self.turning.shape[2], self.sliding.shape[1]

    def at(self, angles_rad: Array, displacements_m: Array) -> tuple[Array, Array]:
        """Normals and distances after these changes."""
        turned = self.normals + self.turning @ angles_rad
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
        return turned, self.distances_m + self.sliding @ displacements_m

    def corners(self, corners_m: Array, meeting: NDArray[np.bool_], error: EstimateOffset) -> Array:
        """Corners of shape (k, d) after an error; ``meeting`` (k, n) marks the sides that meet at each."""
        normals, distances_m = self.at(error.angles_rad, error.displacements_m)
        moved = corners_m.copy()
        for corner, sides in zip(moved, meeting, strict=True):
            corner += np.linalg.pinv(normals[sides]) @ (distances_m[sides] - normals[sides] @ corner)
        return moved


@dataclass(frozen=True)
class EstimateOffset:
    """The error of an estimate.

    Attributes:
        angles_rad, displacements_m: of the sides, see :class:`FlatSides`.
        rows: displacements (x, y, heading) of the contacts of each grasp, zero for the first, shape (k, 3).
    """

    angles_rad: Array
    displacements_m: Array
    rows: Array


@dataclass(frozen=True)
class SeenSession:
    """The truth in the tracked frame, about whose origin the object slips.

    Attributes:
        world_T_frame: rows (x, y, heading), shape (k, 3).
        slips: of the object between grasps, rows, shape (k - 1, 3).
        sigmas: of the slips along x, y (m) and of the heading (rad).
        grasps: of each contact, shape (n,).
        contacts_m, normals: shape (n, 3), as measured.
    """

    world_T_frame: Array
    slips: Array
    sigmas: Array
    grasps: NDArray[np.int64]
    contacts_m: Array
    normals: Array

    @classmethod
    def of(cls, data: SimulatedGrasps, scale: float) -> SeenSession:
        """The truth of simulated grasps with slips of ``scale`` times the full motion noise; heights as in the
        world.
        """
        bodies = [planar(pose) for pose in data.world_T_body]
        body_T_frame = bodies[0].between(planar_pose(data.grasps[0].points_world_m.mean(axis=0)))
        rows = np.array([pose_vector(body.compose(body_T_frame)) for body in bodies])
        index = np.repeat(np.arange(len(rows)), [len(grasp.contacts) for grasp in data.grasps]).astype(np.int64)
        motions = np.array([planar_motion(grasp.hand_motion_world) for grasp in data.grasps[1:]]).reshape(-1, 3)
        slips = compose(inverse(compose(motions, rows[:-1])), rows[1:])
        sigmas = MotionNoise(translation_m=scale * SLIP_SIGMA_m, rotation_rad=scale * SLIP_SIGMA_rad).sigmas
        points = np.concatenate([grasp.points_world_m for grasp in data.grasps])
        normals = np.concatenate([[each.normal_world for each in grasp.contacts] for grasp in data.grasps])
        return cls(rows, slips, sigmas, index, *PLANAR.to_object(rows[index], points, normals))

    def in_frame(self, world_T_body: Pose3, points_body_m: Array) -> Array:
        """Points (n, 3) of the object's model in the tracked frame, from its first pose."""
        placed = transform_points(world_T_body, points_body_m)
        return PLANAR.to_object(self.world_T_frame[0], placed, placed)[0]

    def estimate(self, error: EstimateOffset) -> list[Pose3]:
        """``world_T_frame`` of an estimate with this error."""
        return [spatial(vector_pose(row)) for row in compose(self.world_T_frame, inverse(error.rows))]


@dataclass(frozen=True)
class Limit:
    """The information about flat sides in a session.

    Attributes:
        session: defines the frame of the sides.
        sides: the sides of the object.
        touched: side of each contact, shape (n,).
    """

    session: SeenSession
    sides: FlatSides
    touched: NDArray[np.int64]

    def drawn_error(self, rng: np.random.Generator, *, known_poses: bool) -> EstimateOffset:
        """Draw one error of an efficient estimate.

        Uses the Cholesky factor: in a spectral decomposition the axes of equal variance, which symmetric objects have,
        are arbitrary, so that rounding would determine the error.
        """
        covariance = np.linalg.inv(self._information(known_poses=known_poses))
        return self._error(rng.multivariate_normal(np.zeros(len(covariance)), covariance, method="cholesky"))

    def _information(self, *, known_poses: bool) -> Array:
        """The information matrix of all measurements, for all unknowns or only for the sides."""
        angles, displacements = self.sides.unknown
        poses = 0 if known_poses else self.session.slips.size
        change = approx_fprime(np.zeros(angles + displacements + poses), self._misfit, _STEP)
        weak = np.repeat([_REACH_rad**-2, _REACH_m**-2, 0.0], [angles, displacements, poses])
        return np.asarray(change.T @ change + np.diag(weak))

    def _error(self, unknowns: Array) -> EstimateOffset:
        """The error from one vector; unknowns that it lacks are zero."""
        angles, displacements = self.sides.unknown
        given = np.zeros(angles + displacements + self.session.slips.size)
        given[: len(unknowns)] = unknowns
        first, second, rows = np.split(given, [angles, angles + displacements])
        return EstimateOffset(first, second, np.vstack([np.zeros(3), rows.reshape(-1, 3)]))

    def _misfit(self, unknowns: Array) -> Array:
        """Residuals of points, normals and slips, in standard deviations of their noise; contacts at their true
        points.
        """
        error, seen, dimension = self._error(unknowns), self.session, self.sides.normals.shape[1]
        normals, distances_m = self.sides.at(error.angles_rad, error.displacements_m)
        contacts_m, true = seen.contacts_m[:, :dimension], self.sides.normals[self.touched]
        placed, turned = PLANAR.to_object(inverse(error.rows[seen.grasps]), contacts_m, true)
        beside_m = np.sum(normals[self.touched] * placed, axis=1) - distances_m[self.touched]
        tilted = normals[self.touched] - turned
        slipped = compose(error.rows[:-1], compose(seen.slips, inverse(error.rows[1:])))
        away = deviation(slipped, seen.slips) / seen.sigmas
        return np.concatenate([beside_m / POINT_SIGMA_m, tilted.ravel() / np.tan(NORMAL_SIGMA_rad), away.ravel()])


def together(angles_rad: Array) -> Array:
    """Groups of sides that are parallel or perpendicular to each other, by the angles of their normals, 0 or 1, shape
    (n, groups).
    """
    away = angles_rad[:, None] - angles_rad
    alike = np.abs((away + np.pi / 4) % (np.pi / 2) - np.pi / 4) < _ALIKE_rad
    return np.asarray(np.unique(alike, axis=0).T, dtype=float)
