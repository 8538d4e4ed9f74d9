"""Poses as arms of Universal Robots write them: metres, and a rotation vector in radians."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.contacts import Array


def pose_of(tcp: Sequence[float] | Array) -> Pose3:
    """A pose from three metres and a rotation vector, six numbers."""
    return Pose3(Rot3.Expmap(np.asarray(tcp[3:6], dtype=float)), np.asarray(tcp[:3], dtype=float))


def tcp_of(pose: Pose3) -> Array:
    """The reverse of :func:`pose_of`, shape (6,)."""
    return np.array([*pose.translation(), *Rot3.Logmap(pose.rotation())])
