"""Relative pose between two sets of associated contacts (eq. 3.26), on the table and in space.

Each pair gives two distances between the moved point and its partner: along the partner's normal, and along
the moved point's own, rotated normal. Their squares are minimised by Gauss-Newton over small motions about
the centre of the contacts. Contacts in the plane are treated as contacts in space at height zero, so one
implementation serves SE(2) and SE(3): only the set of free motions differs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.contacts import Array
from drivers.core.errors import TrackingError
from drivers.core.observability import SCALE_m
from drivers.core.poses import rotate, transform_points
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet

LEAST_EIGENVALUE = 1e-3
"""Directions with a smaller eigenvalue of (3.18) are not observed: they are neither moved along nor trusted."""

UNKNOWN_VARIANCE_m2 = 1.0
"""Variance of directions that are not observed: a metre is uninformative for an object in a hand."""

_FREE_MOTIONS = {True: [2, 3, 4], False: [0, 1, 2, 3, 4, 5]}
_MOST_STEPS = 30
_SMALLEST_STEP_m = 1e-9


@dataclass(frozen=True)
class Alignment:
    """A rigid motion that brings one set of contacts onto another.

    Attributes:
        target_T_source: ``target = target_T_source * source``.
        covariance: of a small motion after ``target_T_source``, in the order of gtsam's tangent vectors: (x, y, yaw)
            on the table, (rotation, translation) in space; radians and metres.
        rms_m: root mean square of the remaining distances of (3.26).
        chi_square: remaining squared distances over their variances, counted once a pair.
        degrees_of_freedom: the mean of ``chi_square`` if pairs and noise are correct.
        observable: the pairs resist every free motion.
    """

    target_T_source: Pose3
    covariance: Array
    rms_m: float
    chi_square: float
    degrees_of_freedom: int
    observable: bool


def align(source: ContactSet, target: ContactSet, *, on_table: bool) -> Alignment:
    """Minimise (3.26) over the motion of ``source`` onto ``target``; equal indices are pairs.

    Distances are weighted by their uncertainty: the noise of both points and, as partners touch a face at
    different places, the normals' noise times the distance between the places.

    Args:
        source: contacts to move, in the plane or in space.
        target: as many contacts of the same dimension.
        on_table: only x, y and yaw are free (always so in the plane).

    Raises:
        TrackingError: no pairs, sets of different size, entries that are not finite.
    """
    _check_pairs(source, target)
    free = _FREE_MOTIONS[on_table or source.dimension == 2]
    points, normals = _in_space(source.points_m), _in_space(source.normals)
    onto, onto_normals = _in_space(target.points_m), _in_space(target.normals)
    centre, motion = onto.mean(axis=0), Pose3()
    for _ in range(_MOST_STEPS):
        moved, moved_normals = transform_points(motion, points), rotate(motion, normals)
        distances, rows = _distances(moved, moved_normals, onto, onto_normals, centre)
        sigma = _distance_sigma(source, target, moved - onto, moved_normals, onto_normals)
        step, observed = _gauss_newton(rows[:, free], distances, sigma)
        motion = _small_motion(step, free, centre) * motion
        if np.linalg.norm(step) < _SMALLEST_STEP_m:
            break
    whitened = rows[:, free] / sigma[:, None]
    return Alignment(
        target_T_source=motion,
        covariance=_covariance(whitened, observed, centre, len(free) == 3),
        rms_m=float(np.sqrt(np.mean(distances**2))),
        chi_square=float(np.sum((distances / sigma) ** 2)) / 2,
        degrees_of_freedom=max(len(source) - observed.shape[1], 0),
        observable=observed.shape[1] == len(free),
    )


def _check_pairs(source: ContactSet, target: ContactSet) -> None:
    if len(source) == 0 or source.points_m.shape != target.points_m.shape:
        raise TrackingError(f"{len(source)} and {len(target)} contacts cannot be aligned in pairs")
    columns = (source.points_m, source.normals, target.points_m, target.normals)
    if not all(np.isfinite(column).all() for column in columns):
        raise TrackingError("contacts to align have NaN or infinite entries")


def _in_space(vectors: Array) -> Array:
    missing = 3 - vectors.shape[1]
    return np.pad(vectors, ((0, 0), (0, missing)))


def _distances(moved: Array, normals: Array, onto: Array, onto_normals: Array, centre: Array) -> tuple[Array, Array]:
    """The two distances of each pair, and their derivatives by (rotation * SCALE_m, translation), shape (2 n, 6)."""
    gap, arms = moved - onto, moved - centre
    distances = np.concatenate([np.sum(gap * onto_normals, axis=1), np.sum(gap * normals, axis=1)])
    turning = np.vstack([np.cross(arms, onto_normals), np.cross(arms, normals) + np.cross(normals, gap)])
    return distances, np.hstack([turning / SCALE_m, np.vstack([onto_normals, normals])])


def _distance_sigma(source: ContactSet, target: ContactSet, gap: Array, normals: Array, onto_normals: Array) -> Array:
    """Expected deviation of each distance: both points' noise and the tilt of the normal over the way between them."""
    points = source.point_sigma_m**2 + target.point_sigma_m**2
    tilts = []
    for directions, sigma_rad in ((onto_normals, target.normal_sigma_rad), (normals, source.normal_sigma_rad)):
        along = gap - np.sum(gap * directions, axis=1, keepdims=True) * directions
        tilts.append(points + np.sum(along**2, axis=1) * sigma_rad**2)
    return np.sqrt(np.concatenate(tilts) + 1e-12)


def _gauss_newton(rows: Array, distances: Array, sigma: Array) -> tuple[Array, Array]:
    """The step within the observed directions, and an orthonormal basis of these, shape (free, observed)."""
    values, vectors = np.linalg.eigh(rows.T @ rows / 2)
    observed = vectors[:, values > LEAST_EIGENVALUE]
    reduced = (rows @ observed) / sigma[:, None]
    return observed @ np.linalg.lstsq(reduced, -distances / sigma)[0], observed


def _small_motion(step: Array, free: list[int], centre: Array) -> Pose3:
    """The motion about ``centre`` that a step (rotation * SCALE_m, translation) stands for."""
    full = np.zeros(6)
    full[free] = step
    turn = Rot3.Expmap(full[:3] / SCALE_m)
    return Pose3(turn, centre - turn.matrix() @ centre + full[3:])


def _covariance(whitened: Array, observed: Array, centre: Array, planar: bool) -> Array:
    """Covariance about the frame's origin; the two distances of a pair share their noise, so they count as one."""
    information = observed.T @ (whitened.T @ whitened / 2) @ observed
    hidden = np.eye(len(observed)) - observed @ observed.T
    about_centre = observed @ np.linalg.inv(information) @ observed.T + UNKNOWN_VARIANCE_m2 * hidden
    if planar:  # from (yaw * SCALE, x, y) about the centre to (x, y, yaw) about the origin
        shift = np.array([[centre[1] / SCALE_m, 1, 0], [-centre[0] / SCALE_m, 0, 1], [1 / SCALE_m, 0, 0]])
    else:
        cross = np.array([[0, -centre[2], centre[1]], [centre[2], 0, -centre[0]], [-centre[1], centre[0], 0]])
        shift = np.block([[np.eye(3) / SCALE_m, np.zeros((3, 3))], [cross / SCALE_m, np.eye(3)]])
    return np.asarray(shift @ about_centre @ shift.T)
