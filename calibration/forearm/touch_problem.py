"""Forearm to world from touches: fingertips on faces and points with known poses.

A touch on a face gives one equation (the contact point lies in the face); on a known point it gives three. The contact
point comes from the fingertip's sensor through the kinematics, with the joints' offsets among the unknowns; so is the
error of each face's position, shared by all touches of it.
"""

from __future__ import annotations

from collections.abc import Sequence

import gtsam
import numpy as np
from gtsam import Pose3, Rot3
from pydantic import Field

from calibration.forearm.hand_eye import nearest_rotation
from calibration.steps.hand_chain import HandNoise, joints_of, link_motion, mount_T_link
from calibration.steps.observations import Plane, Touch
from calibration.steps.pose_residuals import PoseResidual
from calibration.steps.refinement import (
    MOUNT,
    OFFSETS,
    JointOffset,
    Measurement,
    Solution,
    marginal,
    minimise,
    outliers,
    prior_of_offsets,
    variance_factor,
)
from drivers.core.contacts import Array
from drivers.core.rotations import skew

_STRAY = 1e-3
"""Weight of the guess in the closed form: it only determines what no touch determines."""

_ROUNDS = 2
_EXACT_m = 1e-6
"""Of a face whose place is stated to be exact."""


class TouchNoise(HandNoise):
    """Errors of a touch, one standard deviation.

    Attributes:
        yield_m_N: how far a tip yields per newton.
        point_sigma_m: least error of a contact point in any direction, whatever its sensor says.
    """

    yield_m_N: float = Field(default=3e-4, gt=0.0)
    point_sigma_m: float = Field(default=3e-4, gt=0.0)


class TouchProblem:
    """All touches of one calibration.

    Args:
        touches: at least as many as the closed form needs (see :mod:`calibration.steps.motion_check`).
        noise: their errors.
        guess: approximate pose of the mount.
    """

    def __init__(self, touches: Sequence[Touch], noise: TouchNoise | None = None, guess: Pose3 | None = None) -> None:
        self.touches, self.noise = tuple(touches), noise or TouchNoise()
        self.joints = joints_of([touch.finger for touch in touches], touches[0].pose.form)
        self._faces = {touch.target.name: touch.target.sigma_m for touch in touches if isinstance(touch.target, Plane)}
        self._start = closed_form(touches, guess or Pose3())

    @property
    def count(self) -> int:
        """Number of touches."""
        return len(self.touches)

    def solve(self, keep: Sequence[int] | None = None, near: Solution | None = None) -> Solution:
        """The refined solution from all touches, or from those in ``keep``."""
        chosen = range(self.count) if keep is None else keep
        values = near.values if near else self._first_values()
        for _ in range(_ROUNDS if near is None else 1):
            measured = self._measurements(chosen, values)
            values = minimise(measured, values)
        return self._solution(measured, values)

    def residuals(self, solution: Solution) -> tuple[PoseResidual, ...]:
        """Residual of each touch: distance from its target, and the angle between the two normals."""
        unknowns = solution.values.atVector(OFFSETS)
        return tuple(self._residual(touch, solution.world_T_mount, unknowns) for touch in self.touches)

    def _first_values(self) -> gtsam.Values:
        values = gtsam.Values()
        values.insert(MOUNT, self._start)
        values.insert(OFFSETS, np.zeros(len(self._prior_sigmas)))
        return values

    def _measurements(self, chosen: Sequence[int], values: gtsam.Values) -> list[Measurement]:
        world_T_mount, offsets = values.atPose3(MOUNT), values.atVector(OFFSETS)
        touches = [self._measurement(self.touches[index], world_T_mount, offsets) for index in chosen]
        return [*touches, prior_of_offsets(self._prior_sigmas)]

    @property
    def _joint_sigmas(self) -> Array:
        """Prior of the joints' offsets."""
        return np.full(len(self.joints), self.noise.joint_offset_rad)

    @property
    def _prior_sigmas(self) -> Array:
        """Of all small unknowns: the joints' offsets, the tips' yield, the faces' shifts along their normals."""
        faces = np.maximum(list(self._faces.values()), _EXACT_m)
        return np.concatenate([self._joint_sigmas, [self.noise.yield_m_N], faces])

    def _measurement(self, touch: Touch, world_T_mount: Pose3, about: Array) -> Measurement:
        """The factor of one touch, linear in the offsets near ``about``."""
        size = len(self.joints)
        motion = link_motion(touch.pose, touch.finger, self.joints, about[:size])
        tip = np.append(touch.point_distal_m, 1.0)
        point, moves = (motion.mount_T_link @ tip)[:3], (motion.derivatives @ tip)[:, :3].T
        directions, place = touch.target.directions(), touch.target.point_world_m
        straight = self._along(touch)

        def evaluate(values: gtsam.Values) -> tuple[Array, list[Array]]:
            pose: Pose3 = values.atPose3(MOUNT)
            rotation = pose.rotation().matrix()
            unknowns = values.atVector(OFFSETS)
            at = point + moves @ (unknowns - about)[:size]
            residual = directions @ (rotation @ at + pose.translation() - place) + straight @ unknowns[size:]
            turned = directions @ rotation
            return residual, [np.hstack([-turned @ skew(at), turned]), np.hstack([turned @ moves, straight])]

        turned = directions @ world_T_mount.rotation().matrix()
        spread = self._point_covariance(touch, motion.mount_T_link[:3, :3], moves)
        own_m = 0.0 if isinstance(touch.target, Plane) else touch.target.sigma_m
        covariance = turned @ spread @ turned.T + own_m**2 * np.eye(len(directions))
        return Measurement((MOUNT, OFFSETS), covariance, evaluate)

    def _along(self, touch: Touch) -> Array:
        """Derivatives of a touch's residual by the tips' yield and the faces' shifts, shape (1 or 3, 1 + faces)."""
        directions = touch.target.directions()
        shifts = np.zeros((len(directions), len(self._faces)))
        if isinstance(touch.target, Plane):
            shifts[0, list(self._faces).index(touch.target.name)] = -1.0
        return np.column_stack([touch.force_N * directions @ _outward(touch), shifts])

    def _point_covariance(self, touch: Touch, mount_R_distal: Array, moves: Array) -> Array:
        """Covariance of a contact point in the mount's frame, offsets aside."""
        variances, axes = np.linalg.eigh(mount_R_distal @ touch.point_covariance_m2 @ mount_R_distal.T)
        sensed = axes * np.maximum(variances, self.noise.point_sigma_m**2) @ axes.T
        joints = self.noise.joint_noise_rad**2 * moves @ moves.T
        return np.asarray(sensed + joints + self.noise.base_sigma_m**2 * np.eye(3))

    def _solution(self, measured: Sequence[Measurement], values: gtsam.Values) -> Solution:
        size = len(self.joints)
        factor = variance_factor(measured, values, 6 + len(self._prior_sigmas))
        scale = max(1.0, factor)
        offsets, spread = values.atVector(OFFSETS), np.sqrt(np.diag(marginal(measured, values, OFFSETS)))
        prior = self.noise.joint_offset_rad
        return Solution(
            world_T_mount=values.atPose3(MOUNT),
            covariance=scale * marginal(measured, values, MOUNT),
            offsets={
                joint: JointOffset(float(offsets[i]), float(spread[i]), prior) for i, joint in enumerate(self.joints)
            },
            variance_factor=factor,
            values=values,
            numbers={"yield_mm_per_N": 1e3 * float(offsets[size]), "yield_sigma_mm_per_N": 1e3 * float(spread[size])},
            outliers=outliers(measured[:-1], values),
        )

    def _residual(self, touch: Touch, world_T_mount: Pose3, unknowns: Array) -> PoseResidual:
        size = len(self.joints)
        link = link_motion(touch.pose, touch.finger, self.joints, unknowns[:size]).mount_T_link
        point = world_T_mount.transformFrom((link @ np.append(touch.point_distal_m, 1.0))[:3])
        off = touch.target.directions() @ (point - touch.target.point_world_m) + self._along(touch) @ unknowns[size:]
        normal = world_T_mount.rotation().matrix() @ link[:3, :3] @ touch.normal_distal
        return PoseResidual(f"{touch.finger} on {touch.target.name}", float(np.linalg.norm(off)), _tilt(touch, normal))


def _outward(touch: Touch) -> Array:
    """Out of what is touched: a point is pressed from above."""
    return touch.target.normal_world if isinstance(touch.target, Plane) else np.array([0.0, 0.0, 1.0])


def _tilt(touch: Touch, normal_world: Array) -> float | None:
    """Angle between the measured and the known normal; None if unknown."""
    if len(touch.target.directions()) != 1:
        return None
    cosine = float(touch.target.directions()[0] @ normal_world)
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)))


def closed_form(touches: Sequence[Touch], guess: Pose3) -> Pose3:
    """The pose that fits best without joint offsets, by linear least squares in the twelve entries of its matrix.

    What the touches do not determine (heights, if all lie in one plane) is taken from the guess; the matrix is
    then brought to the nearest rotation, and the translation solved for again.
    """
    points = np.array([_point_mount_m(touch) for touch in touches])
    rows, wanted, at = [], [], []
    for touch, point in zip(touches, points, strict=True):
        for direction in touch.target.directions():
            rows.append(np.concatenate([np.kron(direction, point), direction]))
            wanted.append(float(direction @ touch.target.point_world_m))
            at.append((direction, point))
    start = guess.rotation().matrix().ravel()
    pull = _STRAY * np.hstack([np.eye(9), np.zeros((9, 3))])
    matrix = np.linalg.lstsq(np.vstack([*rows, pull]), np.concatenate([wanted, _STRAY * start]), rcond=None)[0]
    rotation = nearest_rotation(matrix[:9].reshape(3, 3))
    left = np.array([direction for direction, _ in at])
    right = np.array(wanted) - np.array([direction @ rotation @ point for direction, point in at])
    return Pose3(Rot3(rotation), np.linalg.lstsq(left, right, rcond=None)[0])


def _point_mount_m(touch: Touch) -> Array:
    return np.asarray((mount_T_link(touch.pose, touch.finger) @ np.append(touch.point_distal_m, 1.0))[:3])
