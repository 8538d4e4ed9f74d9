"""Motions on the table as homogeneous matrices."""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array


def planar_matrices(frames: Array) -> Array:
    """Motions from each of n frames, shape (n, 4, 4), to the next, on the table: shape (n - 1, 3, 3)."""
    before, after = frames[:-1], frames[1:]
    turned = after[:, :3, :3] @ before[:, :3, :3].swapaxes(1, 2)
    turns = np.arctan2(turned[:, 1, 0] - turned[:, 0, 1], turned[:, 0, 0] + turned[:, 1, 1])
    planar = np.tile(np.eye(3), (len(turned), 1, 1))
    planar[:, 0, 0] = planar[:, 1, 1] = np.cos(turns)
    planar[:, 1, 0], planar[:, 0, 1] = np.sin(turns), -np.sin(turns)
    planar[:, :2, 2] = after[:, :2, 3] - (turned[:, :2] @ before[:, :3, 3:])[..., 0]
    return planar


def displacements(motions: Array, middle_m: Array) -> Array:
    """Displacement of a point by each planar motion, shape (..., 3, 3), and the motion's angle: shape (..., 3)."""
    moved = motions[..., :2, :2] @ middle_m + motions[..., :2, 2] - middle_m
    turned = np.arctan2(motions[..., 1, 0], motions[..., 0, 0])
    return np.concatenate([moved, turned[..., None]], axis=-1)
