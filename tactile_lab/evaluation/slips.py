"""How far an object slipped relative to the hand between grasps, by the marker camera, and the motion that fits.

The estimation expects slips of a certain size (v of equation 3.7). If it is too small, an
object that slipped is lost; if it is too large, the pose is determined by contacts alone. So it is measured where
ground truth is available.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array, Grasp
from drivers.core.poses import planar
from tactile_lab.evaluation.felt_slips import FeltSlips
from tactile_lab.slam.tracking.contacts.motion import (
    UNHELD,
    MotionNoise,
    compose,
    deviation,
    planar_motion,
    pose_vector,
)
from tactile_lab.slam.tracking.evidence.motion_cost import STIFF_BEYOND_SIGMA

LEAST_STEPS = 10
"""Fewer are not enough for a standard deviation."""

_USUAL_SHARE = 0.75
_SIGMAS_OF_LENGTH, _SIGMAS_OF_TURN = 1.665, 1.150
"""Share of grasps that move an unheld object no more than usual, and the number of standard deviations that contain
this share of a normal distribution, in two dimensions and in one. The other grasps push it (decision 30).
"""

_LEAST_UNHELD = 0.02


@dataclass(frozen=True)
class Slips:
    """Slips of the object between successive grasps that the camera both saw.

    Attributes:
        carried: slips while the hand carried it, as (x_m, y_m, yaw_rad), world frame, shape (n, 3).
        left: slips while it was left in place, shape (m, 3).
        felt: what odometry in the hand missed of the former.
    """

    carried: Array
    left: Array
    felt: FeltSlips = field(default_factory=FeltSlips)

    @classmethod
    def between(cls, grasps: Sequence[Grasp], world_T_object: Sequence[Pose3 | None]) -> Slips:
        """Slips of one session, from its grasps and the true pose at each, None if unknown."""
        found: dict[bool, list[Array]] = {True: [], False: []}
        for (before, _), (after, grasp) in pairwise(zip(world_T_object, grasps, strict=True)):
            if before is not None and after is not None:
                motion = planar_motion(grasp.hand_motion_world)
                expected = compose(motion, pose_vector(planar(before)))
                found[bool(motion.any())].append(deviation(pose_vector(planar(after)), expected))
        return cls(np.array(found[True]).reshape(-1, 3), np.array(found[False]).reshape(-1, 3))

    @classmethod
    def join(cls, parts: Iterable[Slips]) -> Slips:
        """Slips of several sessions."""
        known = list(parts)
        none = [np.empty((0, 3))]
        return cls(
            np.concatenate(none + [each.carried for each in known]),
            np.concatenate(none + [each.left for each in known]),
            FeltSlips.join(each.felt for each in known),
        )

    @property
    def motion(self) -> MotionNoise | None:
        """The matching motion noise; None if the hand carried the object too rarely.

        ``unheld`` stays as it is on every rig, :data:`UNHELD`, if the object was left in place too rarely.
        """
        if len(self.carried) < LEAST_STEPS:
            return None
        translation_m, rotation_rad = root_mean_squares(self.carried)
        share = UNHELD
        if len(self.left) >= LEAST_STEPS:
            usual_m = float(np.quantile(lengths_m(self.left), _USUAL_SHARE)) / _SIGMAS_OF_LENGTH
            usual_rad = float(np.quantile(np.abs(self.left[:, 2]), _USUAL_SHARE)) / _SIGMAS_OF_TURN
            share = min(1.0, max(_LEAST_UNHELD, usual_m / translation_m, usual_rad / rotation_rad))
        return MotionNoise(translation_m=translation_m, rotation_rad=rotation_rad, unheld=share)

    def pushed_count(self, motion: MotionNoise) -> int:
        """Number of grasps of an object left in place that moved it more than ``unheld`` makes likely."""
        lying = motion.after(np.zeros(3))
        far = lengths_m(self.left) > STIFF_BEYOND_SIGMA * lying.translation_m
        return int(np.sum(far | (np.abs(self.left[:, 2]) > STIFF_BEYOND_SIGMA * lying.rotation_rad)))


def lengths_m(slips: Array) -> Array:
    """Length of each slip, shape (n,)."""
    return np.asarray(np.linalg.norm(slips[:, :2], axis=1))


def root_mean_squares(slips: Array) -> tuple[float, float]:
    """Of translations per axis (m), and of rotations (rad)."""
    return float(np.sqrt(np.mean(slips[:, :2] ** 2))), float(np.sqrt(np.mean(slips[:, 2] ** 2)))
