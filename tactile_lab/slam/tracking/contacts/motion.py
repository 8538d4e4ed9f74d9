"""Motion of the object on the table while the hand carries it (eq. 3.7 and 3.8).

Inside the tracker a planar pose ``world_T_object`` is a vector ``(x_m, y_m, yaw_rad)``, so that thousands of
them are one array of shape (n, 3). At module borders poses are gtsam ``Pose2`` and ``Pose3``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Self

import numpy as np
from gtsam import Pose2, Pose3
from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array, StepSigma
from drivers.core.poses import planar, spatial, wrap_angle_rad

_LEAST_m, _LEAST_rad = 1e-5, 1e-4

UNHELD = 0.15
"""Usual share of a carried object's slip that is left where nothing but the closing hand may have moved it (decision
30)."""


class MotionNoise(StrictModel):
    """Standard deviations of the object's slip relative to the hand's motion, per re-orientation.

    The defaults are the thesis's 100 % (section 3.4.1): 10 mm per axis and 20 degrees.

    Attributes:
        translation_m, rotation_rad: per axis, and about the vertical.
        unheld: share of these that applies if the hand did not carry the object between two grasps, and only the
            closing hand may have pushed it. 1 if objects may also be moved by others.
        palm_m: of the palm's position at a grasp, per axis: an error that its contacts have in common, beyond their
            own, and that therefore only the covariances of poses hold.
        gripped: the hand's grip bounds slips, so that large ones are less likely than under a normal distribution.
    """

    renamed: ClassVar = {"left_lying": "unheld"}

    translation_m: float = Field(default=0.010, gt=0)
    rotation_rad: float = Field(default=float(np.deg2rad(20.0)), gt=0)
    unheld: float = Field(default=1.0, gt=0, le=1)
    palm_m: float = Field(default=0.0, ge=0)
    gripped: bool = True

    @property
    def sigmas(self) -> Array:
        """Standard deviations of x, y (m) and yaw (rad)."""
        return np.array([self.translation_m, self.translation_m, self.rotation_rad])

    @property
    def wide(self) -> MotionNoise:
        """The noise by which a step is searched for where it is not likely."""
        return self.accumulate(4)

    @property
    def is_heavy_tailed(self) -> bool:
        """Whether slips far beyond the standard deviations are rare, but not excluded."""
        return False

    def after(self, motions: Array, measured: StepSigma | None = None) -> MotionNoise:
        """The noise of one step after the hand's motions, shape (..., 3): less if the hand did not move the object.

        Args:
            motions: of the hand.
            measured: the step's own, where the fingertips have felt how the object moved.
        """
        if measured is not None:
            return MeasuredNoise.of(measured, self)
        if np.any(motions):
            return self
        factor = self.unheld
        scaled = {"translation_m": factor * self.translation_m, "rotation_rad": factor * self.rotation_rad}
        return self.model_copy(update=scaled)

    def over(self, motions: Array, measured: Sequence[StepSigma | None]) -> MotionNoise:
        """The noise of several steps, motions of shape (n, size), without a measurement of the object between them."""
        known = [each for each in measured if each is not None]
        if len(known) < len(measured):
            return self.after(motions).accumulate(len(measured))
        together = np.linalg.norm([[each.translation_m, each.rotation_rad] for each in known], axis=0)
        return self.after(motions, StepSigma(float(together[0]), float(together[1])))

    def accumulate(self, steps: int) -> MotionNoise:
        """The noise of several re-orientations without a measurement between them."""
        factor = float(np.sqrt(steps))
        translation_m, rotation_rad = factor * self.translation_m, factor * self.rotation_rad
        return self.model_copy(update={"translation_m": translation_m, "rotation_rad": rotation_rad})


class MeasuredNoise(MotionNoise):
    """The noise of a step in which the fingertips felt how the object moved: small, but heavy-tailed.

    A step said to be good to a millimetre may be off by five: then it cost too much under a normal distribution to be
    believed, whatever the contacts say.

    Attributes:
        usual: of a step that was not measured.
    """

    usual: MotionNoise

    @classmethod
    def of(cls, sigma: StepSigma, usual: MotionNoise) -> Self:
        """The noise of a measured step."""
        translation_m = max(sigma.translation_m, _LEAST_m)
        rotation_rad = max(sigma.rotation_rad, _LEAST_rad)
        return cls(translation_m=translation_m, rotation_rad=rotation_rad, gripped=False, usual=usual)

    @property
    def wide(self) -> MotionNoise:
        return self.usual

    @property
    def is_heavy_tailed(self) -> bool:
        return True


def pose_vector(world_T_object: Pose2) -> Array:
    """A planar pose as the vector (x_m, y_m, yaw_rad)."""
    return np.array([world_T_object.x(), world_T_object.y(), world_T_object.theta()])


def vector_pose(row: Array) -> Pose2:
    """The planar pose of a vector (x_m, y_m, yaw_rad)."""
    return Pose2(float(row[0]), float(row[1]), float(row[2]))


def spatial_pose(row: Array, height_m: float) -> Pose3:
    """The pose in space of a planar pose vector, its origin at the given height above the table."""
    return spatial(vector_pose(row), height_m)


def planar_motion(hand_motion_world: Pose3) -> Array:
    """The hand's motion in the table plane as a pose vector: the object rests on the table, so the tilt is ignored."""
    return pose_vector(planar(hand_motion_world))


def compose(motion: Array, rows: Array) -> Array:
    """``motion * pose`` for each pose vector: eq. 3.8, the motion being expressed in the world frame.

    Args:
        motion: one pose vector, or as many as ``rows``.
        rows: shape (3,) or (n, 3).
    """
    cosine, sine = np.cos(motion[..., 2]), np.sin(motion[..., 2])
    x, y = rows[..., 0], rows[..., 1]
    return np.stack(
        [
            cosine * x - sine * y + motion[..., 0],
            sine * x + cosine * y + motion[..., 1],
            wrap_angle_rad(rows[..., 2] + motion[..., 2]),
        ],
        axis=-1,
    )


def inverse(rows: Array) -> Array:
    """The inverse of each planar pose, shape (3,) or (n, 3)."""
    cosine, sine = np.cos(rows[..., 2]), np.sin(rows[..., 2])
    x, y = rows[..., 0], rows[..., 1]
    return np.stack([-cosine * x - sine * y, sine * x - cosine * y, -rows[..., 2]], axis=-1)


def deviation(rows: Array, reference: Array) -> Array:
    """``rows - reference`` with the angle wrapped: the noise v of eq. 3.7."""
    difference = np.asarray(rows - reference)
    difference[..., 2] = wrap_angle_rad(difference[..., 2])
    return difference


def sample_motion(rows: Array, motion: Array, noise: MotionNoise, rng: np.random.Generator) -> Array:
    """Draw the poses after a motion from ``P(x_k | x_{k-1}, u_k)`` (eq. 3.7), one for each of shape (n, 3)."""
    moved = compose(motion, rows) + rng.normal(size=rows.shape) * noise.sigmas
    moved[:, 2] = wrap_angle_rad(moved[:, 2])
    return moved
