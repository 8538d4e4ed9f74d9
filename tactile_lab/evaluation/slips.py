"""How far an object moved beside the hand between grasps, by the marker camera, and the ``motion`` of a rig that fits.

The estimation expects slips of a certain size (v of equation 3.7). Too little, and an object that slipped is lost; too
much, and contacts alone have to say where it is. So it is measured where there is truth.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array, Grasp
from drivers.core.poses import planar
from tactile_lab.slam.tracking.contacts.motion import MotionNoise, compose, deviation, planar_motion, pose_row
from tactile_lab.slam.tracking.evidence.motion_cost import STIFF_BEYOND_SIGMA

LEAST_STEPS = 10
"""Fewer tell no standard deviation."""

_USUAL_SHARE = 0.75
_SIGMAS_OF_LENGTH, _SIGMAS_OF_TURN = 1.665, 1.150
"""So many grasps do no more to an object left lying than closing does, and within how many standard deviations that
share of a normal distribution lies, in two dimensions and in one. The others push it (decision 30)."""

_LEAST_UNHELD = 0.02


@dataclass(frozen=True)
class Slips:
    """Slips of the object between successive grasps at both of which the camera saw it.

    Attributes:
        carried: where the hand had carried it meanwhile, rows (x_m, y_m, yaw_rad), world frame, shape (n, 3).
        left: where it had been left, shape (m, 3).
    """

    carried: Array
    left: Array

    @classmethod
    def between(cls, grasps: Sequence[Grasp], world_T_object: Sequence[Pose3 | None]) -> Slips:
        """Of one session, from its grasps and the true pose at each, None where it is not known."""
        found: dict[bool, list[Array]] = {True: [], False: []}
        for (before, _), (after, grasp) in pairwise(zip(world_T_object, grasps, strict=True)):
            if before is not None and after is not None:
                motion = planar_motion(grasp.hand_motion_world)
                expected = compose(motion, pose_row(planar(before)))
                found[bool(motion.any())].append(deviation(pose_row(planar(after)), expected))
        return cls(*(np.array(found[carried]).reshape(-1, 3) for carried in (True, False)))

    @classmethod
    def join(cls, parts: Iterable[Slips]) -> Slips:
        """Of several sessions."""
        known = list(parts)
        none = [np.empty((0, 3))]
        return cls(
            np.concatenate(none + [each.carried for each in known]),
            np.concatenate(none + [each.left for each in known]),
        )

    @property
    def motion(self) -> MotionNoise | None:
        """The noise that fits; None where the hand carried the object too seldom to tell.

        ``unheld`` stays 1, which is always safe, where the object was left too seldom.
        """
        if len(self.carried) < LEAST_STEPS:
            return None
        translation_m, rotation_rad = root_mean_squares(self.carried)
        share = 1.0
        if len(self.left) >= LEAST_STEPS:
            usual_m = float(np.quantile(lengths_m(self.left), _USUAL_SHARE)) / _SIGMAS_OF_LENGTH
            usual_rad = float(np.quantile(np.abs(self.left[:, 2]), _USUAL_SHARE)) / _SIGMAS_OF_TURN
            share = min(1.0, max(_LEAST_UNHELD, usual_m / translation_m, usual_rad / rotation_rad))
        return MotionNoise(translation_m=translation_m, rotation_rad=rotation_rad, unheld=share)

    def pushed_count(self, motion: MotionNoise) -> int:
        """How many of the grasps that were to leave the object moved it beyond what ``unheld`` makes likely."""
        lying = motion.after(np.zeros(3))
        far = lengths_m(self.left) > STIFF_BEYOND_SIGMA * lying.translation_m
        return int(np.sum(far | (np.abs(self.left[:, 2]) > STIFF_BEYOND_SIGMA * lying.rotation_rad)))


def lengths_m(slips: Array) -> Array:
    """How far each slip goes, shape (n,)."""
    return np.asarray(np.linalg.norm(slips[:, :2], axis=1))


def root_mean_squares(slips: Array) -> tuple[float, float]:
    """Of translations per axis (m), and of turns (rad)."""
    return float(np.sqrt(np.mean(slips[:, :2] ** 2))), float(np.sqrt(np.mean(slips[:, 2] ** 2)))
