"""The thesis's setting of ten hand-made candidate grasps around an object (section 4.5.2, figure 4.8)."""

from __future__ import annotations

import numpy as np
from gtsam import Pose2

from drivers.core.contacts import Array
from tactile_lab.slam.exploration.candidates import Candidate, ClosingRays

TEN_PALMS: Array = np.column_stack(
    [
        np.array([-32, 20, -8, 32, -20, 8, 26, -26, 0, 14]) / 1000,
        np.array([6, -6, 8, 0, -8, 4, 8, 2, -6, 6]) / 1000,
        np.deg2rad(36.0 * np.arange(10)),
    ]
)
"""Palm poses in the object's frame (x m, y m, yaw rad), x along its long side. The thesis shows its own only in a
picture; these ten directions around the object, with offsets along it, need as many random actions.
"""


def candidates_at(palms: Array, world_T_object: Pose2, rays: ClosingRays) -> tuple[Candidate, ...]:
    """Candidates with palms placed relative to the object, rows (x m, y m, yaw rad) of shape (n, 3)."""
    frames = [world_T_object.compose(Pose2(float(x), float(y), float(yaw))) for x, y, yaw in palms]
    return tuple(Candidate(frame, f"palm {index}", rays) for index, frame in enumerate(frames))


def shift(palms: Array, shift_m: float, turn_rad: float) -> Array:
    """Every palm as it is and moved: along and across its own direction, and turned, to both sides; shape (7 n, 3)."""
    steps = np.array([[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    moved = []
    for x, y, yaw in palms:
        turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        places = np.array([x, y]) + shift_m * steps[:, :2] @ turn.T
        moved.append(np.column_stack([places, yaw + turn_rad * steps[:, 2]]))
    return np.concatenate(moved)
