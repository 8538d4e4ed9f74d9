"""The error of in-hand odometry, by the marker camera, relative to its stated standard deviations."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array, Grasp
from drivers.core.poses import planar
from tactile_lab.slam.tracking.contacts.measured_law import as_normal, spread
from tactile_lab.slam.tracking.contacts.motion import compose, deviation, planar_motion, pose_vector

_LEAST_STEPS = 10


@dataclass(frozen=True)
class FeltSlips:
    """Steps that the fingertips measured and the camera saw.

    Attributes:
        missed: true less felt motion, as (x_m, y_m, yaw_rad), world frame, shape (n, 3).
        sigmas: stated standard deviations of translation (m) and rotation (rad), shape (n, 2).
    """

    missed: Array = field(default_factory=lambda: np.empty((0, 3)))
    sigmas: Array = field(default_factory=lambda: np.empty((0, 2)))

    @classmethod
    def between(cls, grasps: Sequence[Grasp], world_T_object: Sequence[Pose3 | None]) -> FeltSlips:
        """Steps of one session, from its grasps and the true pose at each, None if unknown."""
        missed, sigmas = [], []
        for (before, _), (after, grasp) in pairwise(zip(world_T_object, grasps, strict=True)):
            own = grasp.motion_sigma
            if before is not None and after is not None and own is not None:
                expected = compose(planar_motion(grasp.hand_motion_world), pose_vector(planar(before)))
                missed.append(deviation(pose_vector(planar(after)), expected))
                sigmas.append([own.translation_m, own.rotation_rad])
        return cls(np.array(missed).reshape(-1, 3), np.array(sigmas).reshape(-1, 2))

    @classmethod
    def join(cls, parts: Iterable[FeltSlips]) -> FeltSlips:
        """Steps of several sessions."""
        known = [cls(), *parts]
        return cls(np.concatenate([each.missed for each in known]), np.concatenate([each.sigmas for each in known]))

    @property
    def in_sigma(self) -> Array:
        """The missed motions over their standard deviations, shape (n, 3)."""
        return np.asarray(self.missed / self.sigmas[:, [0, 0, 1]])

    def share_within(self, sigmas: float) -> tuple[float, float]:
        """Share of translations and of rotations within this many sigma of the law of measured steps: as many are to be
        as of a normal distribution.
        """
        within = np.abs(as_normal(self.in_sigma)) < sigmas
        return float(within[:, :2].mean()), float(within[:, 2].mean())

    @property
    def scale(self) -> float | None:
        """Factor by which the stated standard deviations should be larger; None for too few steps."""
        if len(self.missed) < _LEAST_STEPS:
            return None
        return spread(self.in_sigma.ravel())

    def in_words(self) -> str:
        """How often the error was within the stated one, and what to change."""
        shares = [self.share_within(sigmas) for sigmas in (1, 2, 3)]
        lengths, turns = (" / ".join(f"{100 * share[part]:.0f}" for share in shares) for part in (0, 1))
        told = f"felt within 1 / 2 / 3 of its own sigma: {lengths} % (mm), {turns} % (°)"
        return told if self.scale is None else f"{told}; to fit, multiply odometry_scale by {self.scale:.2g}"
